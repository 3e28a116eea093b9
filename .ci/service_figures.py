"""The figures of docs/service.md, measured again: what readers cost a design, and what a second worker brings.

    python .ci/service_figures.py load BINARY [PAIRS]
    python .ci/service_figures.py workers BINARY postgres://… [TASKS]

Build BINARY with `cargo build --release`. `load` runs the same design without and with 200 readers and 200 event streams, in
turn, on one thread. `workers` runs the same sweep with one worker and with two, single-threaded each; the database must be
empty. Both print wall and processor seconds: where other programs share the cores, only the latter are the service's own.
"""

import json
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request

HERE = pathlib.Path(__file__).parent
TICKS = 100


def start(*arguments):
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return process, process.stdout.readline().strip().rstrip("/") if "serve" in arguments else ""


def call(address, path, body=None):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(address + path, data, {"content-type": "application/json"} if data else {})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.loads(answer.read())


def finish(address, job):
    while (view := call(address, f"/v1/jobs/{job}"))["state"] in ("queued", "running"):
        time.sleep(0.25)
    assert view["state"] == "succeeded", view
    return (view["finished_ms"] - view["started_ms"]) / 1000


def processor(pid):
    """Processor seconds of a process."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def computing(pid):
    """Processor seconds of the threads that compute: all but the readers'."""
    total = 0
    for stat in pathlib.Path(f"/proc/{pid}/task").glob("*/stat"):
        head, rest = stat.read_text().rsplit(")", 1)
        if "(tokio" not in head:
            fields = rest.split()
            total += int(fields[11]) + int(fields[12])
    return total / TICKS


def load(binary, pairs=4):
    folder = tempfile.TemporaryDirectory()
    service, address = start(binary, "serve", "--listen", "127.0.0.1:0", "--data", folder.name, "--slots", "1", "--threads", "1")
    try:
        study = call(address, "/v1/library")["studies"][0]
        study["materials"] = study["materials"][:1]
        study["budget"] = {"explore": 10, "refine": 1, "iterations": 1, "confirm": 1}
        study["verification"] = {"is_on": False, "draws": 1}
        wall, own = {False: [], True: []}, {False: [], True: []}
        # The first run warms up what runs have in common and is not counted.
        for run in range(2 * pairs + 1):
            is_loaded = run > 0 and run % 2 == 0
            # Another name is another study to the service, and the same work.
            job = call(address, "/v1/designs", {**study, "name": f"run {run}"})["id"]
            before = computing(service.pid)
            all_before = processor(service.pid)
            readers = None
            if is_loaded:
                readers = subprocess.Popen([sys.executable, HERE / "service_load.py", address, "until-it-ends"], stdout=subprocess.PIPE, text=True)
            seconds = finish(address, job)
            slot = computing(service.pid) - before
            serving = processor(service.pid) - all_before - slot
            if readers:
                said, _ = readers.communicate()
                print(said.strip())
                assert readers.returncode == 0, "a request failed"
            print(f"{'with   ' if is_loaded else 'without'} readers: {seconds:.2f} s, the design's threads {slot:.2f} s of processor, serving {serving:.2f} s", flush=True)
            if run > 0:
                wall[is_loaded].append(seconds)
                own[is_loaded].append(slot)
        for name, times in [("wall", wall), ("processor of the design", own)]:
            without, loaded = statistics.median(times[False]), statistics.median(times[True])
            print(f"{name}: median {without:.2f} s without, {loaded:.2f} s with: {100 * (loaded / without - 1):+.1f} %")
    finally:
        service.kill()


def workers(binary, database, tasks=200):
    folder = tempfile.TemporaryDirectory()
    service, address = start(binary, "serve", "--listen", "127.0.0.1:0", "--data", folder.name, "--database", database, "--slots", "0")
    try:
        library = call(address, "/v1/library")
        base = {"specimen": library["specimens"][0], "material": library["materials"][0]["material"], "drive_mm": [1.0], "mesh": "search"}
        walls = {}
        for turn, count in enumerate([1, 2, 1, 2]):
            # Other drives, so that nothing is known from before.
            drives = [1.0 + 2.0 * i / tasks + 1e-5 * turn for i in range(tasks)]
            job = call(address, "/v1/sweeps", {"base": base, "vary": [{"pointer": "/drive_mm/0", "values": drives}]})["id"]
            helpers = [start(binary, "worker", "--database", database, "--slots", "1", "--threads", "1")[0] for _ in range(count)]
            seconds = finish(address, job)
            own = [processor(helper.pid) for helper in helpers]
            for helper in helpers:
                helper.terminate()
                helper.wait()
            walls.setdefault(count, []).append((seconds, max(own)))
            print(f"{count} worker(s): {tasks} tasks in {seconds:.1f} s; processor seconds per worker {', '.join(f'{o:.1f}' for o in own)}", flush=True)
        one, two = (min(walls[n]) for n in (1, 2))
        print(f"two workers take {two[0] / one[0]:.2f} of one's time; the busier one {two[1] / one[1]:.2f} of one's processor time")
    finally:
        service.kill()


what, *more = sys.argv[1:]
numbers = [int(a) if re.fullmatch(r"\d+", a) else a for a in more]
{"load": load, "workers": workers}[what](*numbers)
