"""One tab of Chromium, driven through the DevTools protocol.

Needs the packages websocket-client and axe-core-python, which holds the accessibility rules of axe-core.
"""

import base64
import importlib.util
import json
import pathlib
import subprocess
import tempfile
import time
import urllib.request

import websocket

LONG_S = 900
SIZES = {"wide": (1400, 900), "narrow": (390, 844)}
SCHEMES = ("light", "dark")
RULES = pathlib.Path(importlib.util.find_spec("axe_core_python").origin).with_name("axe.min.js").read_text()
KEYS = {"Tab": 9, "Enter": 13, " ": 32, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "z": 90}


class Page:
    """One tab. `answer` is what the next dialogue is told: True, or a text."""

    def __init__(self, chromium, shots):
        self.shots = shots
        self.answer = True
        self.number, self.errors, self.num_shots, self.num_checked = 0, [], 0, 0
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.process = subprocess.Popen(
            [
                chromium,
                "--headless=new",
                "--no-sandbox",
                "--disable-gpu-sandbox",
                "--use-gl=angle",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--remote-debugging-port=0",
                "--remote-allow-origins=*",
                f"--user-data-dir={self.folder.name}",
                "about:blank",
            ],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        port_file = pathlib.Path(self.folder.name) / "DevToolsActivePort"
        end = time.monotonic() + 120
        while not (port_file.exists() and port_file.read_text().strip()):
            assert time.monotonic() < end, "Chromium did not start"
            time.sleep(0.1)
        port = port_file.read_text().split()[0]
        targets = json.load(urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=30))
        url = next(t for t in targets if t["type"] == "page")["webSocketDebuggerUrl"]
        self.socket = websocket.create_connection(url, timeout=180)
        for domain in ["Page", "Runtime", "Log"]:
            self.send(f"{domain}.enable")
        self.send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(shots.resolve()))
        self.send("Emulation.setScrollbarsHidden", hidden=True)
        self.size("wide")
        self.scheme("light")

    def post(self, method, **parameters):
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": parameters}))
        return self.number

    def send(self, method, **parameters):
        number = self.post(method, **parameters)
        while True:
            message = json.loads(self.socket.recv())
            if message.get("id") == number:
                assert "error" not in message, message
                return message["result"]
            self.hear(message)

    def hear(self, message):
        """Errors are kept, dialogues are answered."""
        method, told = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(told["exceptionDetails"].get("exception", {}).get("description", "exception"))
        if method == "Log.entryAdded" and told["entry"]["level"] == "error":
            self.errors.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")
        if method == "Page.javascriptDialogOpening":
            text = {} if self.answer is True else {"promptText": self.answer}
            self.post("Page.handleJavaScriptDialog", accept=True, **text)

    def js(self, expression):
        found = self.send("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression, limit_s=60):
        end = time.monotonic() + limit_s
        while not self.js(f"!!({expression})"):
            assert time.monotonic() < end, f"not within {limit_s} s: {expression}\n{self.js('document.body.innerText')}"
            time.sleep(0.2)

    def says(self, text, limit_s=60):
        self.until(f"document.body.innerText.includes({json.dumps(text)})", limit_s)

    def open(self, url):
        # A page that differs after the hash alone is not loaded anew by itself.
        self.send("Page.navigate", url="about:blank")
        self.send("Page.navigate", url=url)
        self.until("document.readyState === 'complete' && document.querySelector('main')?.children.length > 0")

    def go(self, view):
        self.js(f"location.hash = '#/{view}'")

    def click(self, text, within="document"):
        """Clicks the button or link of this text."""
        self.js(
            f"[...{within}.querySelectorAll('button, a')]"
            f".find((b) => b.textContent.trim() === {json.dumps(text)}).click()"
        )

    def put(self, label, value):
        """Puts a value into the field whose label begins so."""
        self.js(
            f"""(() => {{ const i = [...document.querySelectorAll('label')]
          .find((l) => l.textContent.startsWith({json.dumps(label)})).control;
          i.value = {json.dumps(value)}; i.dispatchEvent(new Event('change')); }})()"""
        )

    def choose(self, selector, value):
        """Puts a value into the field of this selector."""
        self.js(
            f"""(() => {{ const e = document.querySelector({json.dumps(selector)}); e.value = {json.dumps(value)};
          e.dispatchEvent(new Event('change')); }})()"""
        )

    def files(self, selector, files):
        """Puts files (base64 by name) into a field, as the browser's own dialogue would."""
        self.js(
            f"""(() => {{ const all = new DataTransfer();
          for (const [name, text] of Object.entries({json.dumps(files)}))
          all.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
          const i = document.querySelector({json.dumps(selector)}); i.files = all.files;
          i.dispatchEvent(new Event('change')); }})()"""
        )

    def size(self, name):
        width, height = SIZES[name]
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def scheme(self, name):
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": name}])

    def screen(self, name):
        """Pictures of the whole page in all sizes and schemes, held against the rules; none wider than the screen."""
        for size in SIZES:
            self.size(size)
            for scheme in SCHEMES:
                self.scheme(scheme)
                time.sleep(0.5)
                self.picture(f"{name}-{size}-{scheme}")
                self.accessible(f"{name}, {size}, {scheme}")
            width = self.js("document.documentElement.scrollWidth")
            assert width <= SIZES[size][0], f"{name} is {width} pixels wide on a screen of {SIZES[size][0]}"
        self.size("wide")
        self.scheme("light")

    def picture(self, name):
        self.js("scrollTo(0, 0)")
        size = self.send("Page.getLayoutMetrics")["cssContentSize"]
        clip = {"x": 0, "y": 0, "width": size["width"], "height": min(size["height"], 6000), "scale": 1}
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)["data"]
        self.num_shots += 1
        (self.shots / f"{self.num_shots:02}-{name}.png").write_bytes(base64.b64decode(data))

    def accessible(self, name):
        if not self.js("!!globalThis.axe"):
            self.js(f"{RULES}; 1")
        found = self.js(
            "axe.run(document, { resultTypes: ['violations'] }).then((r) => r.violations.map((v) => "
            "({ id: v.id, impact: v.impact, nodes: v.nodes.slice(0, 4).map((n) =>"
            " n.html.slice(0, 160) + ' | ' + n.any.map((a) => a.message).join(' ')) })))"
        )
        bad = [v for v in found if v["impact"] in ("serious", "critical")]
        self.num_checked += 1
        assert not bad, f"{name}: {json.dumps(bad, indent=1)}"

    def key(self, key, modifiers=0, text=None):
        more = {"text": text} if text else {}
        code = {"windowsVirtualKeyCode": KEYS[key]} if key in KEYS else {}
        self.send("Input.dispatchKeyEvent", type="keyDown", key=key, code=key, modifiers=modifiers, **code, **more)
        self.send("Input.dispatchKeyEvent", type="keyUp", key=key, code=key, modifiers=modifiers, **code)

    def tab_to(self, condition, most=200):
        """Presses Tab until the element that has the focus (`e`) is the one."""
        for _ in range(most):
            self.key("Tab")
            if self.js(f"((e) => !!({condition}))(document.activeElement)"):
                return
        raise AssertionError(f"Tab does not reach it: {condition}")

    def drag(self, start, end):
        self.send("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1)
        for part in range(1, 6):
            x, y = (start[i] + (end[i] - start[i]) * part / 5 for i in range(2))
            self.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.send("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], button="left", clickCount=1)

    def downloaded(self, name):
        """The file of this name, once it has come."""
        path = self.shots / name
        end = time.monotonic() + 120
        while not path.exists():
            assert time.monotonic() < end, f"no download {name}"
            time.sleep(0.2)
        return path

    def close(self):
        self.socket.close()
        self.process.terminate()
        self.process.wait(timeout=60)
