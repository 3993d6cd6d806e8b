"""Exceptions: failures of programs, and reasons why an evaluation has no value."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence


class Place(NamedTuple):
    """A place in a source: line and column count from 1."""

    source: str
    line: int
    column: int


class Frame(NamedTuple):
    """A call that a failure has left unfinished."""

    function: str
    task: str
    place: Optional[Place]
    is_of_library: bool


class Error(Exception):
    """An evaluation has no value."""


class Failure(Error):
    """A failure of a program, or one for a function to fail with: Failure("valve-stuck", [3]).

    `cause` is that of the failure, as the program prints it; `arguments` are its arguments; `frames` are the
    calls that it has left unfinished, innermost first; `report` is what the commands print.
    """

    def __init__(
        self,
        cause: str,
        arguments: Sequence[Any] = (),
        message: Optional[str] = None,
        report: Optional[str] = None,
        frames: Sequence[Any] = (),
    ) -> None:
        self.cause = ":" + cause.lstrip(":").upper()
        self.arguments = list(arguments)
        self.message = message if message is not None else " ".join(map(str, (self.cause, *self.arguments)))
        self.report = report if report is not None else self.message
        self.frames = [
            Frame(function, task, Place(*place) if place else None, is_of_library)
            for function, task, place, is_of_library in frames
        ]
        super().__init__(self.message)

    def __reduce__(self) -> Any:
        return Failure, (self.cause, self.arguments, self.message, self.report, self.frames)


class CompileError(Error):
    """A text cannot be read or compiled. Its message has the errors with their places."""


class Aborted(Error):
    """The evaluation was aborted."""


class Deadlocked(Error):
    """The evaluation waits for an event that no task can signal."""


class BudgetSpent(Error):
    """The budget of the run is spent."""


class Stopped(Error):
    """The run was stopped by a handle."""


class NoMemory(Error):
    """The limit of memory leaves no room."""


class Ended(Error):
    """The engine is gone, or the answer was taken before."""


class NoSuchInput(Error):
    """The program has no input of this name."""


class Full(Error):
    """The input has no room, and its rule is that senders wait."""
