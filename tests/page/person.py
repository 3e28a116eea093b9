"""A person's path through the service's page in Chromium: plan, break a limit, mend it, undo, keep, share; evaluate,
search, sweep, compare; look at a recording, keep it, calibrate on it, diagnose it; the same by keyboard alone. Every
screen is pictured light and dark, wide and narrow, and held against the rules of axe-core.

    python person.py http://127.0.0.1:8080/ SHOTS [chromium]

Needs the packages websocket-client and axe-core-python. Screenshots land in SHOTS.
"""

import base64
import io
import json
import pathlib
import sys
import time
import urllib.request
import zipfile

from browser import LONG_S, Page

address = sys.argv[1].rstrip("/")
shots = pathlib.Path(sys.argv[2])
shots.mkdir(parents=True, exist_ok=True)

HOLE = (
    "(() => { const r = document.querySelectorAll('svg.section .hole')[%d].getBoundingClientRect();"
    " return [r.x + r.width / 2, r.y + r.height / 2]; })()"
)
CX = "Number(document.querySelectorAll('svg.section .hole')[0].getAttribute('cx'))"
CHECK = "document.querySelector('[aria-label=\"Limits and cost\"]').innerText"
KEPT = f"{CHECK}.includes('Every limit is kept')"
LIVE = "document.querySelector('#live') && document.body.innerText.includes('as the base')"
PICTURES = "[...document.images].every((i) => i.complete && i.naturalWidth > 0)"
MAPS = "document.querySelectorAll('svg.map image').length"


def call(path, body=None):
    """The service without the page."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address + path, data, {"content-type": "application/json"} if data else {})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return answer.read()


def zipped_recording():
    """A zip file of a small recording that the service does not know yet. Its specimen's holes are not told, so that no
    material explains it."""
    library = json.loads(call("/v1/library"))
    body = {
        "specimen": {**library["specimens"][0], "drive_mm": [4.0]},
        "material": library["materials"][0]["material"],
        "mesh": "2",
        "voxel_mm": [1.5, 0.7, 1.5],
        "mm_per_radian": [0.4] * 3,
        "noise_sd_mm": [0.01, 0.01, 0.01],
        "seed": 11,
    }
    job = json.loads(call("/v1/scans", body))["id"]
    end = time.monotonic() + LONG_S
    while json.loads(call(f"/v1/jobs/{job}"))["state"] in ("queued", "running"):
        assert time.monotonic() < end, "no scan"
        time.sleep(0.2)
    content = {
        name: call(f"/v1/jobs/{job}/artefacts/{name}")
        for name in ["recording.json", "mask.nii.gz", "u_1.nii.gz", "load.csv"]
    }
    recording = json.loads(content["recording.json"])
    recording["id"] = "a-persons-upload"
    recording["specimen"]["holes"] = []
    content["recording.json"] = json.dumps(recording).encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(f"a-persons-upload/{name}", data)
    return base64.b64encode(packed.getvalue()).decode()


def plan(page):
    """A hole dragged breaks a limit at once; undo brings it back; words at the field; the draft survives, also as a
    file and as a link."""
    page.open(f"{address}/")
    page.until("document.querySelectorAll('svg.section .hole').length === 2")
    page.until(KEPT)
    page.until(LIVE, LONG_S)
    page.screen("plan")

    x, y = page.js(HOLE % 0)
    width = page.js("document.querySelector('svg.section').getBoundingClientRect().width")
    page.drag((x, y), (x - 0.17 * width, y))
    page.until(f"!{KEPT}")
    page.until("document.querySelector('svg.section .broken')")
    page.screen("plan-broken")
    for _ in range(40):
        if page.js(f"{CX} > -4.24 && {CX} < -4.2"):
            break
        page.js("document.activeElement.blur()")
        page.key("z", modifiers=2)
    page.until(KEPT)
    assert page.js("!document.getElementById('redo').disabled")

    page.put("Drives", "five")
    page.says("give numbers such as 5, 9")
    page.js("document.getElementById('evaluate').click()")
    page.until("document.activeElement.value === 'five'")
    page.put("Drives", "5, 4")
    page.until(
        "document.querySelector('[data-pointer=\"/specimen/drive_mm\"]').getAttribute('aria-invalid') === 'true'"
    )
    page.screen("plan-words-at-the-field")
    page.put("Drives", "5")
    page.put("Name", "a person's specimen")
    page.put("Forces read at", "2.5")
    page.put("Load cell’s gain", "1")
    page.until(KEPT)
    page.open(f"{address}/#/plan")
    page.until("[...document.querySelectorAll('input')].some((i) => i.value === \"a person's specimen\")")

    page.choose("select[aria-label='Save as a file']", 2)
    study = page.downloaded("a-person-s-specimen-study.json").read_text()
    assert json.loads(study)["schema"] == "study/1"
    assert json.loads(study)["protocol"] == {"force_drive_mm": [2.5], "force_gain_sd": 0.01}
    link = page.js(
        "import('/assets/draft.js').then((m) =>"
        " m.linkOf({ ...m.kept(), specimen: { ...m.kept().specimen, name: 'linked' } }))"
    )
    page.open(link)
    page.until("[...document.querySelectorAll('input')].some((i) => i.value === 'linked')")
    page.files("#plan-file", {"study.json": base64.b64encode(study.encode()).decode()})
    page.until("[...document.querySelectorAll('input')].some((i) => i.value === \"a person's specimen\")")
    page.put("Forces read at", "")
    page.put("Load cell’s gain", "")
    page.until(KEPT)


def evaluate(page):
    """One drive and the coarse mesh; follow; read; take home."""
    page.choose("select[aria-label=Mesh]", "search")
    page.js("document.getElementById('evaluate').click()")
    page.until("location.hash.startsWith('#/job/')")
    page.says("What the scan promises", LONG_S)
    page.until(f"document.querySelectorAll('canvas').length === 1 && {PICTURES}")
    page.screen("evaluation")
    drawn = page.js(
        """(() => { const c = document.querySelector('canvas'); const gl = c.getContext('webgl'); if (!gl) return -1;
      const p = new Uint8Array(4 * c.width * c.height);
      gl.readPixels(0, 0, c.width, c.height, gl.RGBA, gl.UNSIGNED_BYTE, p);
      let n = 0; for (let i = 3; i < p.length; i += 4) n += p[i] > 0; return n / (c.width * c.height); })()"""
    )
    assert drawn > 0.05, f"the 3D view is empty: {drawn}"
    page.click("specimen.dxf")
    assert "ENTITIES" in page.downloaded("specimen.dxf").read_text()
    page.js("document.getElementById('download-all').click()")
    with zipfile.ZipFile(page.downloaded("a-person-s-specimen.zip")) as archive:
        assert archive.testzip() is None and {"result.json", "request.json", "specimen.stl"} <= set(
            archive.namelist()
        ), archive.namelist()


def search(page):
    """A design with the smallest budget, watched live; base against chosen; the chosen one as the next plan."""
    page.go("plan")
    page.until("document.getElementById('design')")
    for label, value in [
        ("Designs sampled", "6"),
        ("Designs improved", "1"),
        ("Steps of each", "1"),
        ("Designs confirmed", "1"),
    ]:
        page.put(label, value)
    page.js("document.getElementById('design').click()")
    # On a service that knows the study already there is no progress to see.
    page.until(
        "document.querySelector('progress') || document.body.innerText.includes('gain over the base specimen')", LONG_S
    )
    page.until(
        "(document.body.innerText.includes('of the whole') && document.querySelector('svg.section.still'))"
        " || document.body.innerText.includes('gain over the base specimen')",
        LONG_S,
    )
    page.screen("design-running")
    page.says("gain over the base specimen", LONG_S)
    page.until(f"document.querySelectorAll('canvas').length === 2 && {PICTURES}")
    page.screen("design")
    page.js("document.getElementById('use-design').click()")
    page.until("location.hash === '#/plan' && document.getElementById('undo')")
    page.until(LIVE.replace("as the base", "%"), LONG_S)


def sweep(page):
    """One axis, three points; a point opened as a plan."""
    page.until("document.querySelector('#sweep-form input')")
    page.choose("select[aria-label=Mesh]", "search")
    page.put("Evaluations", 3)
    page.until("document.getElementById('sweep-form').innerText.includes('3 evaluations')")
    page.js("document.getElementById('sweep').click()")
    page.until("document.querySelectorAll('svg.plot circle').length === 3", LONG_S)
    page.screen("sweep")
    names = page.js("[...document.querySelectorAll('ul.files a')].map((a) => a.textContent)")
    assert {"table.csv", "table.parquet"} <= set(names), names
    page.js("document.querySelector('svg.plot circle').dispatchEvent(new Event('click'))")
    page.until("location.hash === '#/plan' && document.getElementById('undo')")


def recordings(page):
    """A zip file looked at before it is kept; the fit that must not be believed, with its maps by keyboard; the
    diagnosis that it leads to; what to scan next."""
    page.go("recordings")
    page.until("document.getElementById('recording-zip')")
    # Files of another program: what they are is asked, and they are kept as a recording.
    matlab = pathlib.Path(__file__).resolve().parents[1] / "data" / "import" / "v73.mat"
    page.files("#recording-files", {"v73.mat": base64.b64encode(matlab.read_bytes()).decode()})
    page.until("document.body.innerText.includes('What is v73.mat?')")
    page.screen("files-of-another-program")
    page.click("Upload")
    page.until("[...document.querySelectorAll('section.sheet h3')].some((h) => h.textContent === 'v73')")
    page.files("#recording-zip", {"recording.zip": zipped_recording()})
    page.until(f"{MAPS} === 1 && document.body.innerText.includes('The load cell')")
    page.screen("recording-looked-at")
    page.click("Upload")
    mine = (
        "[...document.querySelectorAll('section.sheet')].find((s) =>"
        " s.querySelector('h3')?.textContent === 'a-persons-upload' && s.querySelector('.calibrate'))"
    )
    page.until(mine)
    page.screen("recordings")
    # The service keeps it: whoever comes later can look at it, too.
    page.open(f"{address}/#/recordings")
    page.until(f"{mine} && {MAPS} === 0")
    page.js(f"{mine}.querySelector('button.look').click()")
    page.until(f"{MAPS} === 1 && document.body.innerText.includes('The load cell')")
    page.screen("recording-kept")

    page.js(f"""(() => {{ const s = {mine}; for (const [label, value] of [["Mesh", "2"], ["Number of terms", "1"]]) {{
      const e = s.querySelector(`select[aria-label='${{label}}']`); e.value = value;
      e.dispatchEvent(new Event('change')); }} s.querySelector('button.calibrate').click(); }})()""")
    page.until("location.hash.startsWith('#/job/')")
    page.until(f"{MAPS} === 2 && {PICTURES}", LONG_S)
    first = page.js("document.querySelector('section.sheet .callout, section.sheet table').className")
    assert first == "callout bad", "a calibration says first that it cannot be believed"
    before = page.js("document.querySelector('.slices output').textContent")
    page.js("document.querySelector('.slices input[type=range]').focus()")
    is_first = page.js(
        "(() => { const r = document.querySelector('.slices input[type=range]'); return r.value === r.min; })()"
    )
    page.key("ArrowRight" if is_first else "ArrowLeft")
    page.until(f"document.querySelector('.slices output').textContent !== {json.dumps(before)}")
    page.screen("calibration")

    page.click("Diagnose: find what was left out")
    page.says("diagnosis of a-persons-upload")
    page.until("document.querySelector('progress') || document.querySelector('.callout')", LONG_S)
    page.screen("diagnosis-running")
    page.until(f"{MAPS} === 2 && {PICTURES}", LONG_S)
    assert "Before" in page.js("document.querySelector('.slices figcaption').textContent")
    page.put("Plane", "1")
    page.until("document.querySelector('.slices output').textContent.startsWith('y')")
    page.screen("diagnosis")

    page.go("recordings")
    page.until(mine)
    page.js(f"""(() => {{ const s = {mine};
      for (const [label, value] of [["Precision asked", "0.01"], ["Number of terms", "1"]]) {{
        const e = s.querySelector(`select[aria-label='${{label}}']`); e.value = value;
        e.dispatchEvent(new Event('change')); }} s.querySelector('button.next').click(); }})()""")
    page.until("location.hash.startsWith('#/job/')")
    page.until(f"document.querySelector('.callout') && {PICTURES}", LONG_S)
    page.says("sd of μ₁")
    page.screen("next-scan")


def compare_and_tidy(page):
    """Two results side by side from the list; the list filtered, a job named, another one deleted."""
    page.go("jobs")
    page.until("document.querySelectorAll('tbody tr').length >= 4")
    page.put("Kind", "evaluations")
    page.answer = "the first evaluation"
    page.js("[...document.querySelectorAll('tbody button')].filter((b) => b.textContent === 'Rename').at(-1).click()")
    page.answer = True
    page.says("the first evaluation")
    page.put("Kind", "")
    page.screen("jobs")
    page.js(
        "(() => { const rows = [...document.querySelectorAll('tbody tr')];"
        " for (const kind of ['evaluation', 'design search'])"
        " rows.find((r) => r.cells[2].textContent === kind).querySelector('input').click(); })()"
    )
    page.js("document.getElementById('compare').click()")
    page.says("Promised deviation of")
    page.until(f"document.querySelectorAll('canvas').length === 2 && {PICTURES}")
    page.screen("compare")
    page.go("jobs")
    page.until("document.querySelectorAll('tbody tr').length >= 4")
    page.js(
        "(() => { const rows = [...document.querySelectorAll('tbody tr')];"
        " for (const kind of ['calibration', 'diagnosis'])"
        " rows.find((r) => r.cells[2].textContent === kind).querySelector('input').click(); })()"
    )
    page.js("document.getElementById('compare').click()")
    page.says("What each leaves")
    page.until(f"{MAPS} === 2 && {PICTURES}")
    page.screen("compare-what-is-left")
    page.go("jobs")
    page.until("document.querySelectorAll('tbody tr').length >= 4")
    sweep = "[...document.querySelectorAll('tbody tr')].find((r) => r.cells[2].textContent === 'sweep')"
    link = page.js(f"{sweep}.querySelector('a').hash")
    page.js(f"{sweep}.querySelector('button[aria-label^=Delete]').click()")
    page.until(f"![...document.querySelectorAll('tbody a')].some((a) => a.hash === {json.dumps(link)})")


def keyboard_only(page):
    """From the page's head to a result without a pointer."""
    page.open(f"{address}/#/plan")
    page.until("document.querySelectorAll('svg.section .hole').length > 0")
    page.until("document.getElementById('undo')")
    page.tab_to("e.classList.contains('hole')")
    before = page.js(CX)
    page.key("ArrowLeft")
    page.until(f"{CX} !== {before}")
    page.tab_to("e.id === 'evaluate'")
    page.key("Enter", text="\r")
    page.until("location.hash.startsWith('#/job/')")
    page.says("What the scan promises", LONG_S)
    page.tab_to("e.tagName === 'CANVAS'")
    page.key("ArrowLeft")
    page.tab_to("e.id === 'download-all'")


def interface(page):
    page.open(f"{address}/docs")
    page.until("document.querySelectorAll('details').length > 20")
    page.screen("interface")


page = Page(sys.argv[3] if len(sys.argv) > 3 else "chromium", shots)
try:
    for part in [plan, evaluate, search, sweep, recordings, compare_and_tidy, keyboard_only, interface]:
        part(page)
        print(f"{part.__name__}: done", flush=True)
    # The service's no to a specimen that cannot be made is an answer, which browsers log as an error.
    errors = [e for e in page.errors if "422" not in e and "400" not in e]
    assert not errors, errors
finally:
    page.close()
print(
    f"a person's path: {page.num_shots} screenshots, {page.num_checked} checks of accessibility without serious"
    " findings, no errors in the browser"
)
