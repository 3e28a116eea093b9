"""A person's path through the page in real headless Chromium: open, draw, evaluate, read, download, sweep, upload a recording,
calibrate on it, diagnose it.

    python person.py http://127.0.0.1:8080/ SHOTS [chromium]

Needs the package websocket-client. Speaks the DevTools protocol; screenshots land in SHOTS.
"""

import base64
import json
import pathlib
import subprocess
import sys
import tempfile
import time
import urllib.request

import websocket

address = sys.argv[1].rstrip("/")
shots = pathlib.Path(sys.argv[2])
chromium = sys.argv[3] if len(sys.argv) > 3 else "chromium"
shots.mkdir(parents=True, exist_ok=True)
LONG_S = 600


class Page:
    """One tab."""

    def __init__(self, size):
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.process = subprocess.Popen(
            [chromium, "--headless=new", "--no-sandbox", "--disable-gpu-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
             "--enable-unsafe-swiftshader", "--remote-debugging-port=0", "--remote-allow-origins=*",
             f"--user-data-dir={self.folder.name}", f"--window-size={size[0]},{size[1]}", "about:blank"],
            stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        port_file = pathlib.Path(self.folder.name) / "DevToolsActivePort"
        end = time.monotonic() + 120
        while not (port_file.exists() and port_file.read_text().strip()):
            assert time.monotonic() < end, "Chromium did not start"
            time.sleep(0.1)
        port = port_file.read_text().split()[0]
        targets = json.load(urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=30))
        url = next(t for t in targets if t["type"] == "page")["webSocketDebuggerUrl"]
        self.socket = websocket.create_connection(url, timeout=180)
        self.number, self.errors = 0, []
        for domain in ["Page", "Runtime", "Log"]:
            self.send(f"{domain}.enable")
        self.send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(shots.resolve()))
        self.send("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False)

    def send(self, method, **parameters):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv())
            if message.get("method") == "Runtime.exceptionThrown":
                self.errors.append(message["params"]["exceptionDetails"].get("exception", {}).get("description", "exception"))
            if message.get("method") == "Log.entryAdded" and message["params"]["entry"]["level"] == "error":
                self.errors.append(message["params"]["entry"]["text"])
            if message.get("id") == self.number:
                assert "error" not in message, message
                return message["result"]

    def js(self, expression):
        found = self.send("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression, limit_s=60):
        end = time.monotonic() + limit_s
        while not self.js(f"!!({expression})"):
            assert time.monotonic() < end, f"not within {limit_s} s: {expression}\n{self.js('document.body.innerText')}"
            time.sleep(0.2)

    def open(self, url):
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete'")

    def shot(self, name, whole=False):
        time.sleep(0.5)
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"] if not whole else self._whole()
        (shots / f"{name}.png").write_bytes(base64.b64decode(data))

    def _whole(self):
        size = self.send("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": min(size["height"], 6000), "scale": 1}
        return self.send("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)["data"]

    def key(self, key, code=None, text=None):
        more = {"text": text} if text else {}
        self.send("Input.dispatchKeyEvent", type="keyDown", key=key, code=code or key, **more)
        self.send("Input.dispatchKeyEvent", type="keyUp", key=key, code=code or key)

    def drag(self, start, end):
        self.send("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1)
        for part in range(1, 6):
            x, y = (start[i] + (end[i] - start[i]) * part / 5 for i in range(2))
            self.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.send("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], button="left", clickCount=1)

    def scheme(self, name):
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])

    def close(self):
        self.socket.close()
        self.process.terminate()
        self.process.wait(timeout=60)


def call(path, body=None):
    """The service without the page."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address + path, data, {"content-type": "application/json"} if data else {})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read()


def small_recording():
    """The files of a small recording that the service does not know yet, base64 by name."""
    library = json.loads(call("/v1/library"))
    body = {"specimen": {**library["specimens"][1], "drive_mm": [4.0]}, "material": library["materials"][0]["material"],
            "mesh": "2.5", "voxel_mm": [2.0, 0.7, 2.0], "mm_per_radian": [0.4] * 3, "noise_sd_mm": [0.01, 0.01, 0.01], "seed": 11}
    job = json.loads(call("/v1/scans", body))["id"]
    end = time.monotonic() + LONG_S
    while json.loads(call(f"/v1/jobs/{job}"))["state"] in ("queued", "running"):
        assert time.monotonic() < end, "no scan"
        time.sleep(0.2)
    folder = shots / "recording"
    folder.mkdir(exist_ok=True)
    for name in ["recording.json", "mask.nii.gz", "u_1.nii.gz", "load.csv"]:
        (folder / name).write_bytes(call(f"/v1/jobs/{job}/artefacts/{name}"))
    recording = json.loads((folder / "recording.json").read_text())
    recording["id"] = "a-persons-upload"
    (folder / "recording.json").write_text(json.dumps(recording))
    return {path.name: base64.b64encode(path.read_bytes()).decode() for path in sorted(folder.iterdir())}


HOLE = "(() => { const r = document.querySelectorAll('svg.section .hole')[%d].getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()"
CHECK = "document.querySelector('[aria-label=\"Limits and cost\"]').innerText"

page = Page((1280, 900))
try:
    page.scheme("light")
    page.open(f"{address}/")
    page.until("document.querySelectorAll('svg.section .hole').length === 2")
    page.until(f"{CHECK}.includes('Every limit is kept')")
    page.shot("1-plan", whole=True)

    # A hole dragged to the edge breaks a limit at once; the keyboard brings it back.
    x, y = page.js(HOLE % 0)
    width = page.js("document.querySelector('svg.section').getBoundingClientRect().width")
    page.drag((x, y), (x - 0.18 * width, y))
    page.until(f"!{CHECK}.includes('Every limit is kept')")
    page.shot("2-broken")
    page.js("document.querySelectorAll('svg.section .hole')[0].focus()")
    for _ in range(45):
        page.key("ArrowRight")
        time.sleep(0.02)
        if page.js("Number(document.querySelectorAll('svg.section .hole')[0].getAttribute('cx'))") >= -4.5:
            break
    page.until(f"{CHECK}.includes('Every limit is kept')")

    # One drive and the coarse mesh; evaluate; follow; read.
    page.js("(() => { const m = document.querySelector('select[aria-label=Mesh]'); m.value = 'search'; m.dispatchEvent(new Event('change')); })()")
    page.js("(() => { const d = [...document.querySelectorAll('label')].find((l) => l.textContent.startsWith('Drives')).querySelector('input'); d.value = '5'; d.dispatchEvent(new Event('change')); })()")
    page.js("document.getElementById('evaluate').focus()")
    page.key("Enter", text="\r")
    page.until("location.hash.startsWith('#/job/')")
    page.shot("3-running")
    page.until("document.body.innerText.includes('What the scan promises')", LONG_S)
    page.until("document.querySelectorAll('canvas').length === 1 && [...document.images].every((i) => i.complete)")
    page.shot("4-evaluation", whole=True)
    drawn = page.js("""(() => { const c = document.querySelector('canvas'); const gl = c.getContext('webgl'); if (!gl) return -1;
      const p = new Uint8Array(4 * c.width * c.height); gl.readPixels(0, 0, c.width, c.height, gl.RGBA, gl.UNSIGNED_BYTE, p);
      let n = 0; for (let i = 3; i < p.length; i += 4) n += p[i] > 0; return n / (c.width * c.height); })()""")
    assert drawn > 0.05, f"the 3D view is empty: {drawn}"
    page.scheme("dark")
    page.shot("5-evaluation-dark", whole=True)
    page.scheme("light")

    # A downloaded result.
    page.js("[...document.querySelectorAll('ul.files a')].find((a) => a.textContent === 'specimen.dxf').click()")
    end = time.monotonic() + 60
    while not (shots / "specimen.dxf").exists():
        assert time.monotonic() < end, "no download"
        time.sleep(0.2)
    assert "ENTITIES" in (shots / "specimen.dxf").read_text()

    # A design with the smallest budget, watched live; then base against chosen.
    page.js("location.hash = '#/plan'")
    page.until("document.getElementById('design')")
    for label, value in [("Designs sampled", 6), ("Designs improved", 1), ("Steps of each", 1), ("Designs confirmed", 1)]:
        page.js(f"(() => {{ const i = [...document.querySelectorAll('label')].find((l) => l.textContent.startsWith('{label}')).querySelector('input'); i.value = {value}; i.dispatchEvent(new Event('change')); }})()")
    page.js("document.getElementById('design').click()")
    # On a service that knows the study already there is no progress to see.
    page.until("document.querySelector('progress') || document.body.innerText.includes('gain over the base specimen')", LONG_S)
    page.shot("6-design-running")
    page.until("document.body.innerText.includes('gain over the base specimen')", LONG_S)
    page.until("document.querySelectorAll('canvas').length === 2")
    page.shot("7-design", whole=True)

    # A sweep: one axis, three points.
    page.js("location.hash = '#/plan'")
    page.until("document.querySelector('#sweep-form input')")
    page.js("(() => { const m = document.querySelector('select[aria-label=Mesh]'); m.value = 'search'; m.dispatchEvent(new Event('change')); })()")
    page.js("(() => { const i = [...document.querySelectorAll('#sweep-form label')].find((l) => l.textContent.startsWith('Evaluations')).querySelector('input'); i.value = 3; i.dispatchEvent(new Event('change')); })()")
    page.until("document.getElementById('sweep-form').innerText.includes('3 evaluations')")
    page.shot("8-sweep-form", whole=True)
    page.js("document.getElementById('sweep').focus()")
    page.key("Enter", text="\r")
    page.until("document.querySelectorAll('svg.plot circle').length === 3", LONG_S)
    page.shot("9-sweep", whole=True)
    names = page.js("[...document.querySelectorAll('ul.files a')].map((a) => a.textContent)")
    assert {"table.csv", "table.parquet"} <= set(names), names

    # A recording uploaded by hand; the material found from it; its maps, by keyboard.
    files = small_recording()
    page.js("location.hash = '#/recordings'")
    page.until("document.getElementById('recording')")
    # The dialogue for folders is the browser's own; what it would give is put into the field.
    page.js(f"""(() => {{ const all = new DataTransfer(); for (const [name, text] of Object.entries({json.dumps(files)}))
      all.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name)); document.getElementById('recording').files = all.files; }})()""")
    page.until("document.getElementById('recording').files.length === 4")
    page.js("[...document.querySelectorAll('button')].find((b) => b.textContent === 'Upload').click()")
    page.until("document.body.innerText.includes('a-persons-upload')")
    page.shot("10-recordings")
    mine = "[...document.querySelectorAll('section.sheet')].find((s) => s.innerText.includes('a-persons-upload'))"

    def start(button, settings):
        page.js(f"(() => {{ const s = {mine}; for (const [label, value] of {json.dumps(settings)}) {{ const e = s.querySelector(`select[aria-label='${{label}}']`); e.value = value; e.dispatchEvent(new Event('change')); }} s.querySelector('button.{button}').click(); }})()")
        page.until("location.hash.startsWith('#/job/')")

    start("calibrate", [["Mesh", "2"], ["Number of terms", "1"]])
    page.until("document.querySelectorAll('canvas.slice').length === 2", LONG_S)
    page.until("[...document.images].every((i) => i.complete)")
    drawn = "[...document.querySelectorAll('canvas.slice')].map((c) => { const p = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0; for (let i = 3; i < p.length; i += 4) n += p[i] > 0; return n; })"
    assert min(page.js(drawn)) > 20, page.js(drawn)
    before = page.js("document.querySelector('.slices output').textContent")
    page.js("document.querySelector('.slices input[type=range]').focus()")
    page.key("ArrowRight")
    page.until(f"document.querySelector('.slices output').textContent !== {json.dumps(before)}")
    page.shot("11-calibration", whole=True)
    page.scheme("dark")
    page.shot("12-calibration-dark", whole=True)
    page.scheme("light")

    # Diagnosed: maps before and after on one scale.
    page.js("location.hash = '#/recordings'")
    page.until("document.body.innerText.includes('a-persons-upload')")
    start("diagnose", [["Mesh", "2"], ["Material as believed", "0"]])
    page.until("document.querySelectorAll('canvas.slice').length === 2", LONG_S)
    assert "Before" in page.js("document.querySelector('.slices figcaption').textContent")
    page.js("(() => { const s = [...document.querySelectorAll('.slices label')].find((l) => l.textContent.startsWith('Plane')).querySelector('select'); s.value = '1'; s.dispatchEvent(new Event('change')); })()")
    page.until("document.querySelector('.slices output').textContent.startsWith('y')")
    page.until("[...document.images].every((i) => i.complete)")
    page.shot("13-diagnosis", whole=True)

    page.js("location.hash = '#/jobs'")
    page.until("document.querySelectorAll('tbody tr').length >= 2")
    page.shot("14-jobs")
    page.open(f"{address}/docs")
    page.until("document.querySelectorAll('details').length > 20")
    page.shot("15-interface")
    assert not page.errors, page.errors
finally:
    page.close()
print("a person's path: 15 screenshots, no errors in the browser")
