"""ESL, the Execution Support Language, for programs in Python.

    import esl

    engine = esl.Engine()

    @engine.function
    def read_sensor(number):
        "The temperature at a sensor, in degrees."
        return 20 + 0.5 * number

    engine.eval("(loop for s to 5 when (> (read-sensor s) 21) collect s)")  # [3, 4, 5]
"""

from .engine import Engine, Facts, Input, Inputs
from .errors import (
    Aborted,
    BudgetSpent,
    CompileError,
    Deadlocked,
    Ended,
    Error,
    Failure,
    Frame,
    Full,
    NoMemory,
    NoSuchInput,
    Place,
    Stopped,
)
from .values import Character, Dotted, Keyword, Object, Symbol

__all__ = [
    "Aborted",
    "BudgetSpent",
    "Character",
    "CompileError",
    "Deadlocked",
    "Dotted",
    "Ended",
    "Engine",
    "Error",
    "Facts",
    "Failure",
    "Frame",
    "Full",
    "Input",
    "Inputs",
    "Keyword",
    "NoMemory",
    "NoSuchInput",
    "Object",
    "Place",
    "Stopped",
    "Symbol",
]
