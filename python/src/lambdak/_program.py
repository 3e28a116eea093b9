"""Finds the program and runs it. Everything that this package computes goes through :func:`run_program`."""

from __future__ import annotations

import atexit
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Callable, Dict, List, Mapping, NoReturn, Optional, Sequence, Set, Union

from ._errors import (
    InputError,
    LambdakError,
    NoSolutionError,
    ProgramError,
    ProgramMissingError,
    Stopped,
    TimeLimitError,
    WorseError,
    WriteError,
)

PathLike = Union[str, "os.PathLike[str]"]
OnProgress = Callable[[str], None]

VARIABLE = "LAMBDAK_PROGRAM"
_FILE_NAME = "lambdak.exe" if sys.platform == "win32" else "lambdak"
EXIT_STOPPED = 130
_ERROR_OF_EXIT_CODE: Dict[int, Callable[[str], LambdakError]] = {
    3: NoSolutionError,
    4: WriteError,
}


def program_path() -> Path:
    """The program: $LAMBDAK_PROGRAM, else what this package was installed with, else `lambdak` on PATH."""
    named = os.environ.get(VARIABLE)
    if named:
        if os.path.isfile(named) and os.access(named, os.X_OK):
            return Path(named)
        raise ProgramMissingError(f"{VARIABLE} is {named!r}, which is no program; set it to lambdak's path or unset it")
    places = _script_folders()
    for place in places:
        if (place / _FILE_NAME).is_file():
            return place / _FILE_NAME
    on_path = shutil.which("lambdak")
    if on_path is not None:
        return Path(on_path)
    looked = ", ".join(str(place) for place in places)
    raise ProgramMissingError(
        f"the program lambdak is neither in {looked} nor on PATH; install it with "
        f"`pip install --force-reinstall lambdak`, or set {VARIABLE} to the path of one that was built with "
        "`cargo build --release`"
    )


def _script_folders() -> List[Path]:
    """Where pip puts programs: of this environment, of this user, and beside a package that was put into a folder."""
    folders = [Path(sysconfig.get_path("scripts"))]
    # Python 3.9 cannot be asked for the scheme of user installations.
    preferred = getattr(sysconfig, "get_preferred_scheme", lambda _: f"{os.name}_user")
    folders.append(Path(sysconfig.get_path("scripts", preferred("user"))))
    folders.append(Path(__file__).resolve().parent.parent / "bin")
    return list(dict.fromkeys(folders))


def program_version() -> str:
    """The version of the program that is run."""
    said = subprocess.run([str(program_path()), "--version"], capture_output=True, text=True, check=False)
    if said.returncode != 0:
        raise ProgramError(f"{program_path()} --version ended with {said.returncode}: {said.stderr.strip()}")
    return said.stdout.split()[-1]


# Folders of results that no caller has named.
_temporary: Set[str] = set()
_owner = os.getpid()


def temporary_folder(name: str) -> Path:
    """A new folder that is deleted when Python ends."""
    folder = tempfile.mkdtemp(prefix=f"lambdak-{name}-")
    _temporary.add(folder)
    return Path(folder)


@atexit.register
def _delete_temporary_folders() -> None:
    # A forked process ends with its parent's list; the folders are still the parent's.
    if os.getpid() == _owner:
        for folder in _temporary:
            shutil.rmtree(folder, ignore_errors=True)


def _keep(folder: Path) -> None:
    if str(folder) in _temporary and any(folder.iterdir()):
        _temporary.discard(str(folder))


@dataclass(frozen=True)
class Finished:
    """A run that succeeded."""

    result: Dict[str, Any]
    folder: Path


def run_program(
    command: Sequence[str],
    request: Mapping[str, Any],
    *,
    name: str,
    folder: Optional[PathLike] = None,
    threads: Optional[int] = None,
    on_progress: Optional[OnProgress] = None,
    has_time_limit: bool = False,
    has_files: bool = True,
) -> Finished:
    """Runs `lambdak COMMAND REQUEST.json --json --out FOLDER` with `request`, plain JSON, in a file.

    The calling thread reads the program's progress and waits; other threads of Python run meanwhile. On
    `KeyboardInterrupt`, or an error of `on_progress`, the program is asked to stop and waited for.
    """
    program = program_path()
    out = Path(folder) if folder is not None else temporary_folder(name) if has_files else Path()
    with tempfile.TemporaryDirectory(prefix="lambdak-request-") as scratch:
        # Results are named after the request's file where they name their input.
        file = Path(scratch) / f"{name}.json"
        file.write_text(encoded(request), encoding="utf-8")
        arguments = [str(program), *command, str(file), "--json"]
        arguments += [f"--out={out}"] if has_files else []
        arguments += [] if threads is None else [f"--threads={threads}"]
        ended = _run(arguments, on_progress)
    message = _message(ended.lines, str(file))
    # A program that has not yet begun to listen for SIGINT is ended by it.
    is_stopped = ended.exit_code in (EXIT_STOPPED, -signal.SIGINT)
    if ended.interrupt is not None or is_stopped:
        # What was found has to outlive this process: the search can go on from it.
        _keep(out)
    if isinstance(ended.interrupt, KeyboardInterrupt):
        # No class of this package's own: only of this very class does Python end as shells expect after Ctrl-C.
        raise KeyboardInterrupt(message) from None
    if ended.interrupt is not None:
        raise ended.interrupt
    if is_stopped:
        error = TimeLimitError if has_time_limit else Stopped
        raise error(message or "stopped", out, _unfinished(out) if has_files else None)
    if ended.exit_code != 0:
        _fail(ended, message)
    try:
        return Finished(json.loads(ended.output), out)
    except ValueError as error:
        raise ProgramError(f"{program} printed no JSON ({error}); is it another program, or another version?") from None


def encoded(request: Mapping[str, Any]) -> str:
    """JSON text of plain values."""
    problems = [f"{where} is {value}; JSON holds finite numbers alone" for where, value in _not_finite(request, "")]
    if problems:
        raise InputError(tuple(problems))
    return json.dumps(request)


def _not_finite(value: Any, where: str) -> List[Any]:
    if isinstance(value, float):
        return [] if math.isfinite(value) else [(where, value)]
    if isinstance(value, Mapping):
        return [found for key, part in value.items() for found in _not_finite(part, f"{where}/{key}")]
    if isinstance(value, (list, tuple)):
        return [found for index, part in enumerate(value) for found in _not_finite(part, f"{where}/{index}")]
    return []


@dataclass(frozen=True)
class _Ended:
    exit_code: int
    output: str
    lines: List[str]
    interrupt: Optional[BaseException]


def _run(arguments: Sequence[str], on_progress: Optional[OnProgress]) -> _Ended:
    # A terminal sends Ctrl-C to every process of its group, and a second one ends the program at once. In the main
    # thread Python gets it and passes it on, so the program leaves the group; other threads never see a Ctrl-C, and
    # there the program has to get it from the terminal itself.
    is_main = threading.current_thread() is threading.main_thread()
    try:
        process = subprocess.Popen(
            arguments,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            errors="replace",
            start_new_session=is_main,
            creationflags=_new_group() if is_main else 0,
        )
    except OSError as error:
        raise ProgramMissingError(f"{arguments[0]} cannot be run: {error.strerror}") from None
    lines: List[str] = []
    interrupt: Optional[BaseException] = None
    output: List[str] = []
    assert process.stdout is not None and process.stderr is not None
    reader = threading.Thread(target=_read_all, args=(process.stdout, output), daemon=True)
    try:
        reader.start()
        for line in process.stderr:
            text = line.strip()
            if text:
                lines.append(text)
                if on_progress is not None and not text.startswith("lambdak: "):
                    on_progress(text)
        process.wait()
    except BaseException as error:
        interrupt = error
        _stop(process, process.stderr, lines)
    reader.join()
    process.stdout.close()
    process.stderr.close()
    return _Ended(process.returncode, "".join(output), lines, interrupt)


def _new_group() -> int:
    """What start_new_session is elsewhere; there it counts for nothing."""
    if sys.platform == "win32":
        return subprocess.CREATE_NEW_PROCESS_GROUP
    return 0


def _ask_to_stop(process: "subprocess.Popen[str]") -> None:
    if sys.platform == "win32":
        # A group of its own can be sent no other event.
        process.send_signal(signal.CTRL_BREAK_EVENT)
    else:
        process.send_signal(signal.SIGINT)


def _read_all(stream: IO[str], output: List[str]) -> None:
    output.append(stream.read())


def _stop(process: "subprocess.Popen[str]", stderr: IO[str], lines: List[str]) -> None:
    """Asks the program to stop and waits. A second Ctrl-C makes it end at once, a third one kills it."""
    for send in (_ask_to_stop, _ask_to_stop, subprocess.Popen.kill):
        try:
            send(process)
            lines += [line.strip() for line in stderr if line.strip()]
            process.wait()
            return
        except KeyboardInterrupt:
            continue
    process.wait()


def _message(lines: List[str], file: str) -> str:
    """The program's error: what follows its name at the end of stderr, without the temporary file's name."""
    first = next((n for n, line in enumerate(lines) if line.startswith(("lambdak: ", "error: "))), len(lines))
    own = [line[len("lambdak: ") :] if line.startswith("lambdak: ") else line for line in lines[first:]]
    return "\n".join(line[len(file) + 2 :] if line.startswith(f"{file}: ") else line for line in own)


def _unfinished(folder: Path) -> Optional[Mapping[str, Any]]:
    file = folder / "unfinished-design.json"
    if not file.is_file():
        return None
    found: Dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def _fail(ended: _Ended, message: str) -> NoReturn:
    code = ended.exit_code
    if code < 0:
        cause = signal.Signals(-code).name
        hint = "; there may have been too little memory" if cause == "SIGKILL" else ""
        raise ProgramError(f"the program was ended by {cause}{hint}. {message}".strip())
    if not message:
        # It did not come so far as to speak: the system says why, such as a library that is too old.
        raise ProgramError(f"the program ended with {code}: {' '.join(ended.lines[-5:])}")
    if code == 2:
        # Errors of fields are a line each; those of the command line are one text over several lines.
        problems = (message[len("error: ") :],) if message.startswith("error: ") else tuple(message.splitlines())
        raise InputError(problems)
    if code == 1:
        raise WorseError(message, json.loads(ended.output))
    raise _ERROR_OF_EXIT_CODE.get(code, ProgramError)(message)
