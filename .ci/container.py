"""Does what Dockerfile and compose.yaml say without Docker; `.ci/container` prepares it.

What stands in for Docker is small: a folder in the place of a volume, free ports of this machine in the place of a network, a
process of the image's user in the place of a container. Commands, user, environment, health check and numbers of containers are
read from the two files.
"""

import argparse
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "api" / "python"))
from lambdak_client import Client  # noqa: E402

HEALTHY_WITHIN_S = 60
SWEEP_WITHIN_S = 300


def instructions(text):
    """The instructions of a Dockerfile as (name, rest), continued lines joined, without comments."""
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    joined = re.sub(r"\\\n\s*", "", "\n".join(lines))
    return [tuple(line.split(None, 1)) for line in joined.splitlines() if line.strip()]


def check_context(dockerfile, scratch, program):
    """What is copied exists, is what the program's build reads, and makes a package whose targets are all there."""
    context = scratch / "context"
    copied = []
    for name, rest in dockerfile:
        words = rest.split()
        if name != "COPY" or words[0].startswith("--from"):
            continue
        copied += words[:-1]
    for source in copied:
        # Copied into the second stage alone, it is no part of the build.
        place = context / source
        place.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / source).is_dir() else shutil.copy)(ROOT / source, place)
    read = (program.parent / "lambdak.d").read_text().split(":", 1)[1].split()
    inside = [Path(file) for file in read if Path(file).is_relative_to(ROOT)]
    if not inside:
        raise SystemExit(f"{program} was not built here: {program.parent / 'lambdak.d'} names no file of {ROOT}")
    missing = [str(file) for file in inside if not (context / file.relative_to(ROOT)).is_file()]
    if missing:
        raise SystemExit(f"Dockerfile does not copy what the program is built of: {', '.join(missing)}")
    described = subprocess.run(
        ["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"], cwd=context, capture_output=True, text=True
    )
    if described.returncode != 0:
        raise SystemExit(f"what Dockerfile copies is no package: {described.stderr}")
    print(f"container: the context holds all {len(inside)} files that the program is built of")


class Machine:
    """Starts processes as the image's user, with addresses and folders of this machine, and ends them all."""

    def __init__(self, program, user, folder):
        self.program, self.folder, self.started = program, folder, []
        # The folder of a checkout may be closed to the image's user.
        self.own = folder / "lambdak"
        shutil.copy(program, self.own)
        self.own.chmod(0o755)
        uid, gid = (user.split(":") + [user])[:2]
        if os.getuid() == 0:
            self.prefix = ["setpriv", f"--reuid={uid}", f"--regid={gid}", "--clear-groups"]
            self.owner = (int(uid), int(gid))
        else:
            print("container: not root, so that nothing is run as the image's user")
            self.prefix, self.owner = [], (os.getuid(), os.getgid())

    def volume(self, name):
        made = self.folder / name
        made.mkdir(mode=0o750)
        os.chown(made, *self.owner)
        return made

    def start(self, name, arguments, environment=None):
        log = open(self.folder / f"{name}.log", "w")
        process = subprocess.Popen(
            [*self.prefix, str(self.own), *arguments],
            cwd="/",
            env={"PATH": os.environ["PATH"], **(environment or {})},
            stdout=log,
            stderr=log,
        )
        self.started.append((name, process))

    def run(self, arguments):
        return subprocess.run(
            [*self.prefix, str(self.own), *arguments], cwd="/", capture_output=True, text=True, check=True
        ).stdout

    def end(self):
        """Ends everything as `docker stop` does; each process must end in good order."""
        for _, process in self.started:
            process.send_signal(signal.SIGTERM)
        for name, process in self.started:
            code = process.wait(timeout=30)
            log = (self.folder / f"{name}.log").read_text()
            if code not in (0, 130, 143) or "panicked" in log:
                raise SystemExit(f"{name} ended with {code}:\n{log}")
        self.started = []

    def kill(self):
        for _, process in self.started:
            process.kill()


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


def moved(text, port, volume):
    """A text of the files with this machine's port and folder in the place of the container's."""
    return re.sub(r"(?<![\w./])/data(?=/|$)", str(volume), text.replace("0.0.0.0:8080", f"127.0.0.1:{port}"))


def wait_healthy(check, port):
    """Runs the image's health check until it succeeds."""
    command = [word.replace("/127.0.0.1/8080", f"/127.0.0.1/{port}") for word in check]
    if command == check:
        raise SystemExit("the health check of Dockerfile does not ask port 8080 of its own container")
    end = time.monotonic() + HEALTHY_WITHIN_S
    while subprocess.run(command, capture_output=True).returncode != 0:
        if time.monotonic() > end:
            raise SystemExit(f"not healthy after {HEALTHY_WITHIN_S} s: {shlex.join(command)}")
        time.sleep(0.2)


def add_token(machine, volume):
    """The documented first command: it makes a token and prints it."""
    said = machine.run(["serve", "--tokens", str(volume / "tokens.json"), "--add-token", "me:admin"])
    return next(word for word in said.split() if len(word) >= 32)


def specimen_and_material():
    specimen = json.loads((ROOT / "geometries/solid-shear.json").read_text())
    return specimen, json.loads((ROOT / "geometries/materials/ecoflex-0020.json").read_text())


def alone(machine, command, check):
    """The image without arguments: `docker run -v lambdak:/data lambdak`."""
    port, volume = free_port(), machine.volume("alone")
    token = add_token(machine, volume)
    machine.start("service", [moved(word, port, volume) for word in command])
    wait_healthy(check, port)
    specimen, material = specimen_and_material()
    client = Client(f"http://127.0.0.1:{port}", token)
    result = client.evaluate(specimen, material, drive_mm=[2], mesh="search").result(SWEEP_WITHIN_S)
    print(f"container: the image's command is healthy, and evaluates a force of {result['steps'][0]['force_n']:.3f} N")
    machine.end()


def together(machine, compose, check, database):
    """`docker compose up`: the service, whose slots are none, and the workers on the database."""
    port, volume = free_port(), machine.volume("together")
    token = add_token(machine, volume)

    def here(text):
        address = "postgres://lambdak:${POSTGRES_PASSWORD}@database/lambdak"
        return moved(text.replace(address, database), port, volume)

    service, worker = compose["services"]["service"], compose["services"]["worker"]
    machine.start("service", [here(word) for word in service["command"]])
    wait_healthy(check, port)
    replicas = worker["deploy"]["replicas"]
    environment = {name: here(value) for name, value in worker["environment"].items()}
    for number in range(replicas):
        machine.start(f"worker-{number}", [here(word) for word in worker["command"]], environment)
    specimen, material = specimen_and_material()
    client = Client(f"http://127.0.0.1:{port}", token)
    base = {"specimen": specimen, "material": material, "drive_mm": [2], "mesh": "search"}
    lengths = [24.0, 25.0, 26.0, 27.0]
    result = client.sweep(base, {"/specimen/block/length_mm": lengths}).result(SWEEP_WITHIN_S)
    forces = [entry["evaluation"]["steps"][0]["force_n"] for entry in result["evaluations"]]
    if sorted(forces) != forces or len(forces) != len(lengths):
        raise SystemExit(f"longer blocks must take more force: {forces}")
    print(f"container: the service and {replicas} workers on PostgreSQL finished a sweep of {len(lengths)}")
    machine.end()


def main():
    parser = argparse.ArgumentParser()
    for name in ("program", "scratch"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--database", required=True)
    options = parser.parse_args()
    program = options.program.resolve()
    dockerfile = instructions((ROOT / "Dockerfile").read_text())
    said = dict(dockerfile)
    if said["USER"].split(":")[0] in ("0", "root"):
        raise SystemExit("the image's user is root")
    check_context(dockerfile, options.scratch, program)
    machine = Machine(program, said["USER"], options.scratch)
    check = json.loads(said["HEALTHCHECK"].split("CMD", 1)[1])
    compose = YAML(typ="safe").load((ROOT / "compose.yaml").read_text())
    try:
        alone(machine, json.loads(said["CMD"]), check)
        together(machine, compose, check, options.database)
    finally:
        machine.kill()


if __name__ == "__main__":
    main()
