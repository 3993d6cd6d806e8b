"""Pictures of a run, for notebooks."""

from __future__ import annotations

import html
from typing import Any, NamedTuple, Optional

from . import _esl


class Event(NamedTuple):
    """Something that has happened to a task: seconds since the first observer came, the number of the task (0 if it
    is no task's), the kind, and a detail.

    | kind | detail |
    |---|---|
    | begins, named | the name of the task |
    | runs, ready | nothing: its turn begins; it could go on, but another task does |
    | waits, suspended | the object of the wait; the task that suspended it |
    | to-end, ends | nothing; `succeeded`, `failed` or `aborted` |
    | signals, woken | the event |
    | fails, recovers | the cause |
    | asserts, retracts | the fact, as a short text |
    | collection-begins, pause-begins, pause-ends, collection-ends | nothing: a collection of garbage |
    """

    time: float
    task: int
    kind: str
    detail: Optional[str]


class Timeline:
    """A drawing of a run: a row for each task, with what it did when. A notebook shows it."""

    def __init__(self, timeline: _esl.Timeline) -> None:
        self._timeline = timeline
        self._svg: Optional[str] = None

    @property
    def svg(self) -> str:
        """The drawing as the text of an SVG file. The first use ends the drawing."""
        if self._svg is None:
            self._svg = self._timeline.svg()
        return self._svg

    def __enter__(self) -> "Timeline":
        return self

    def __exit__(self, *_: object) -> None:
        self._timeline.stop()

    def _repr_svg_(self) -> str:
        return self.svg


class TaskInfo(NamedTuple):
    """A task of a program: its number, that of its maker (0 if Python is), its name, the object of its wait (None if
    it can run), and the ticks that it has used."""

    number: int
    maker: int
    name: str
    waits_for: Optional[str]
    ticks: int


class Tasks(list[TaskInfo]):
    """The tasks of a program that have not ended. A notebook shows them as a tree."""

    def children(self, number: int) -> list[TaskInfo]:
        """Returns the tasks that the one with this number has made."""
        return [task for task in self if task.maker == number]

    def _roots(self) -> list[TaskInfo]:
        numbers = {task.number for task in self}
        return [task for task in self if task.maker not in numbers]

    def _lines(self) -> list[tuple[int, TaskInfo]]:
        """Returns each task below its maker, with its depth."""
        lines: list[tuple[int, TaskInfo]] = []
        rest = [(0, task) for task in reversed(self._roots())]
        while rest:
            depth, task = rest.pop()
            lines.append((depth, task))
            rest.extend((depth + 1, child) for child in reversed(self.children(task.number)))
        return lines

    @staticmethod
    def _state(task: TaskInfo) -> str:
        return "can run" if task.waits_for is None else f"waits for {task.waits_for}"

    def __str__(self) -> str:
        lines = (f"{'  ' * depth}{task.name}: {self._state(task)}" for depth, task in self._lines())
        return "\n".join(lines) or "no tasks"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(str(self))

    def _repr_html_(self) -> str:
        rows = "".join(
            f'<tr><td style="text-align:left;padding-left:{8 + 20 * depth}px">{html.escape(task.name)}</td>'
            f'<td style="text-align:left">{html.escape(self._state(task))}</td><td>{task.ticks}</td></tr>'
            for depth, task in self._lines()
        )
        return f"<table><tr><th>task</th><th>state</th><th>ticks</th></tr>{rows}</table>"
