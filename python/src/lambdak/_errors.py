"""What a call can fail with: the program's exit codes as exceptions, with the program's own words."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Mapping, Optional, Tuple


class LambdakError(Exception):
    """Whatever this package raises of its own."""


class ProgramMissingError(LambdakError):
    """The program `lambdak` is nowhere to be found."""


class MissingPackageError(LambdakError, ImportError):
    """An optional package (pandas, xarray) is not installed."""


class InputError(LambdakError, ValueError):
    """Something of what was given cannot be used (exit code 2). Nothing was computed.

    `problems` holds one text for each thing that is wrong: its place, its value, what is allowed, what to change.
    """

    def __init__(self, problems: Tuple[str, ...]) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems

    def __reduce__(self) -> Tuple[Any, ...]:
        return (InputError, (self.problems,))


class WorseError(LambdakError):
    """A compared result is worse than the one that it is compared with (exit code 1); `raw` is the comparison."""

    def __init__(self, message: str, raw: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.raw = raw


class NoSolutionError(LambdakError):
    """The input is valid, and no solution was found (exit code 3)."""


class WriteError(LambdakError):
    """A file cannot be written (exit code 4)."""


class ProgramError(LambdakError):
    """The program ended in a way that it does not know itself, such as by a signal for want of memory."""


class Stopped(LambdakError):
    """Somebody else than this call stopped the program, such as Ctrl-C while a thread of Python waits for it.

    (Ctrl-C in the main thread is a `KeyboardInterrupt`.) `folder` holds what was found, and the same call with that
    folder goes on from there; `unfinished` is that result, `None` where nothing was kept.
    """

    def __init__(self, message: str, folder: Path, unfinished: Optional[Mapping[str, Any]]) -> None:
        super().__init__(message)
        self.folder = folder
        self.unfinished = unfinished


class TimeLimitError(Stopped):
    """The time limit of a search is over."""
