"""ESL, the Execution Support Language, for programs in Python.

    import esl

    engine = esl.Engine()

    @engine.function
    def read_sensor(number):
        "The temperature at a sensor, in degrees."
        return 20 + 0.5 * number

    engine.eval("(loop for s to 5 when (> (read-sensor s) 21) collect s)")  # [3, 4, 5]

`Engine` is where to begin; a `DurableEngine` goes on after the end of its process. Values of programs that Python has no type for are in `esl.values`, exceptions in `esl.errors`;
`esl.run` and `esl.replay` run whole programs. `esl.pytest_plugin` makes tests in ESL items of pytest,
`%load_ext esl.ipython` gives notebooks the magic `%%esl`.
"""

import os

from . import _esl
from ._esl import Handle, Input, ProgramObject, Recording
from .display import Event, TaskInfo, Tasks, Timeline
from .durable import DurableEngine, Resumed, action, restore, save
from .engine import Definition, Engine
from .errors import (
    Aborted,
    BudgetSpent,
    CompileError,
    Deadlocked,
    Diagnostic,
    Diverged,
    Ended,
    Error,
    Exited,
    Failure,
    Frame,
    Full,
    NoMemory,
    NoSuchInput,
    NotDurable,
    Place,
    Stopped,
)
from .facts import FactChange, Facts, Inputs, Subscription
from .program import Replay, RunResult, check, check_file, replay, run
from .values import Character, Dotted, Keyword, Object, Symbol, Table

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_esl.note_fork)

__all__ = [
    "Aborted",
    "BudgetSpent",
    "Character",
    "CompileError",
    "Deadlocked",
    "Definition",
    "Diagnostic",
    "Diverged",
    "Dotted",
    "DurableEngine",
    "Ended",
    "Engine",
    "Error",
    "Event",
    "Exited",
    "FactChange",
    "Facts",
    "Failure",
    "Frame",
    "Full",
    "Handle",
    "Input",
    "Inputs",
    "Keyword",
    "NoMemory",
    "NoSuchInput",
    "NotDurable",
    "Object",
    "Place",
    "ProgramObject",
    "Recording",
    "Replay",
    "Resumed",
    "RunResult",
    "Stopped",
    "Subscription",
    "Symbol",
    "Table",
    "TaskInfo",
    "Tasks",
    "Timeline",
    "action",
    "check",
    "check_file",
    "replay",
    "restore",
    "run",
    "save",
]
