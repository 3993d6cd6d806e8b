"""Whole programs: their diagnostics, runs of them, recordings of runs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Callable, Iterable, NamedTuple, Optional, Union

from . import _esl
from .engine import Size, rights_of, size_of
from .errors import Diagnostic, diagnostics_of

PathLike = Union[str, "os.PathLike[str]"]


class RunResult(NamedTuple):
    """The end of a run: the exit status, as the command `eslvm` has it, and the report of the failure or the deadlock
    that has ended it."""

    status: int
    report: Optional[str]


class Replay(NamedTuple):
    """A run that was run again. It was the same run if `status` is there; `difference` says what differs; without
    either the recording ends before the run does."""

    status: Optional[int]
    difference: Optional[str]
    output: str
    errors: str
    ticks: int


def check(text: str, name: str = "<text>") -> list[Diagnostic]:
    """Compiles a text without running it. Returns its errors and warnings."""
    return diagnostics_of(_esl.check(name, text, None))


def check_file(path: PathLike) -> list[Diagnostic]:
    """Compiles a source file, with the modules beside it, without running it. Returns its errors and warnings."""
    file = Path(path)
    return diagnostics_of(_esl.check(str(file), file.read_text(encoding="utf-8"), file))


def run(
    path: PathLike,
    *,
    recording: Optional[PathLike] = None,
    clock: str = "real",
    allow: Iterable[str] = (),
    memory: Optional[Size] = None,
    seed: int = 0,
    budget: Optional[int] = None,
    arguments: Iterable[str] = (),
    output: Optional[Callable[[str], object]] = None,
) -> RunResult:
    """Runs the program of a file to its end, as the command `eslvm` does. With `recording`, writes a recording of the run
    to that file, which `replay` and `eslvm replay` run again. The parameters are those of `Engine`; `arguments` are
    the command line of the program."""
    if clock not in ("real", "virtual"):
        raise ValueError(f"`{clock}` is not a clock: expected `real` or `virtual`")
    status, report = _esl.run(
        path, recording, clock == "virtual", rights_of(allow), size_of(memory), seed, budget, list(arguments), output
    )
    return RunResult(status, report)


def replay(recording: PathLike) -> Replay:
    """Runs a recorded run again, to its end, without its outside."""
    return Replay(*_esl.replay(recording))
