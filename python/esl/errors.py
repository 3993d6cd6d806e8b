"""Exceptions: failures of programs, and reasons why an evaluation has no value."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence


class Place(NamedTuple):
    """A place in a source: line and column count from 1."""

    source: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.source}:{self.line}:{self.column}"


class Frame(NamedTuple):
    """A call that a failure has left unfinished."""

    function: str
    task: str
    place: Optional[Place]
    is_of_library: bool


class Diagnostic(NamedTuple):
    """A finding about a source text: an error, which keeps it from running, or a warning.

    `code` is kebab-case, such as "unclosed-list"; docs/diagnostics.md explains each. `place` and `end` bound the part
    of the text that it is about; `label` is a note on that part, `help` says what to do.
    """

    severity: str
    code: str
    message: str
    place: Place
    end: Place
    label: str
    help: Optional[str]

    def __str__(self) -> str:
        return f"{self.place}: {self.severity}[{self.code}]: {self.message}"


def diagnostics_of(rows: Sequence[Any]) -> list[Diagnostic]:
    """Returns the diagnostics of rows of the extension module."""
    return [
        Diagnostic(severity, code, message, Place(*place), Place(*end), label, help)
        for severity, code, message, place, end, label, help in rows
    ]


class Error(Exception):
    """An evaluation has no value."""


class Failure(Error):
    """A failure of a program, or one for a function to fail with: Failure("valve-stuck", [3]).

    `cause` is that of the failure, as the program prints it: ":VALVE-STUCK". `arguments` are its arguments, `message` is
    its text, `report` is what the commands print, and `frames` are the calls that it has left unfinished, innermost
    first.
    """

    cause: str
    arguments: list[Any]
    message: str
    report: str
    frames: list[Frame]

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
    """A text cannot be read or compiled. `diagnostics` has the errors as data, the message has them as the commands
    print them."""

    diagnostics: list[Diagnostic]

    def __init__(self, message: str, diagnostics: Sequence[Any] = ()) -> None:
        self.diagnostics = diagnostics_of(diagnostics)
        super().__init__(message)

    def __reduce__(self) -> Any:
        return CompileError, (str(self), self.diagnostics)


class Exited(Error):
    """The program has ended itself: `(exit 3)` has the `status` 3. All its tasks are aborted, with their cleanups."""

    status: int

    def __init__(self, status: int) -> None:
        self.status = status
        super().__init__(f"the program has ended with the status {status}")

    def __reduce__(self) -> Any:
        return Exited, (self.status,)


class Aborted(Error):
    """The evaluation was aborted."""


class Deadlocked(Error):
    """The evaluation waits for an event that no task can signal."""


class BudgetSpent(Error):
    """The budget of the run is spent."""


class Stopped(Error):
    """The run was stopped by a handle."""


class Diverged(Error):
    """The engine replays a recording, and does something else than the recorded engine did."""


class NotDurable(Error):
    """The folder of a durable run is in use, damaged, cannot be written, or has the run of another program."""


class NoMemory(Error):
    """The limit of memory leaves no room."""


class Ended(Error):
    """The engine is gone, or the answer was taken before."""


class NoSuchInput(Error):
    """The program has no input of this name."""


class Full(Error):
    """The input has no room, and its rule is that senders wait."""
