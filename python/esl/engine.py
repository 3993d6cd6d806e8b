"""Engines: machines in which programs run."""

from __future__ import annotations

import atexit
import inspect
import os
import time
import weakref
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any, AsyncIterator, Callable, Iterable, NamedTuple, Optional, TypeVar, Union

from . import _esl
from ._diagnosis import error_of, error_of_file
from ._progress import StatusLine
from ._signature import Signature, arguments_of, program_name, signature_of
from ._workers import run_in_thread
from .display import Event, TaskInfo, Tasks, Timeline
from .errors import CompileError, Ended, Failure
from .facts import Facts, Inputs, Subscription

if TYPE_CHECKING:
    from ._loop import Awaited, Loop

# Ticks after which signals of the process and other tasks of a loop have their turn.
PORTION = 100_000

F = TypeVar("F", bound=Callable[..., Any])

# A number of bytes, or a text such as "64M".
Size = Union[int, str]

_engines: "weakref.WeakSet[Engine]" = weakref.WeakSet()


class Definition(NamedTuple):
    """A definition of a program.

    `kind` is "function", "operation", "macro", "property", "input", "variable" or "constant"; `parameters` are written
    as in the program: "metres &key (speed 0.1)".
    """

    kind: str
    name: str
    parameters: str
    documentation: str


def size_of(memory: Optional[Size]) -> Optional[int]:
    """Returns a size as a number of bytes."""
    if not isinstance(memory, str):
        if memory is not None and memory < 0:
            raise ValueError(f"{memory} is not a size: expected a number of bytes, or a text such as \"64M\"")
        return memory
    units = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}
    digits, unit = (memory[:-1], memory[-1].upper()) if memory[-1:].upper() in units else (memory, "")
    if not digits.isdigit():
        raise ValueError(f"`{memory}` is not a size: expected a number, optionally followed by K, M or G")
    return int(digits) * units.get(unit, 1)


def rights_of(allow: Iterable[str]) -> list[str]:
    """Returns rights as a list of texts."""
    if isinstance(allow, str):
        raise TypeError(f"rights are a list of texts: allow=[{allow!r}]")
    return list(allow)


class Engine:
    """A machine with the library of ESL. Definitions last from one evaluation to the next.

    An engine serves one thread at a time; other threads reach it by `handle()` and `inputs`. It ends with the last
    reference to it, or with the process: tasks that are left are aborted, and run their cleanups.

    :param clock: "real", or "virtual": time that passes only while all tasks wait
    :param allow: rights as the options --allow-… have them: ["net=127.0.0.1:1883"]; none by default
    :param memory: limit of memory, a number of bytes or a text such as "64M"
    :param seed: seed of random numbers
    :param budget: ticks (calls and turns of loops) of the whole run
    :param output: function called with the texts that programs write, in place of the standard streams
    :param record: keeps a recording, which `recording()` returns
    :param replay: a recording to be repeated, without clocks, functions of Python or other outside. The engine gets the
        same definitions and texts as the recorded one; another course is `esl.Diverged`
    """

    def __init__(
        self,
        *,
        clock: str = "real",
        allow: Iterable[str] = (),
        memory: Optional[Size] = None,
        seed: int = 0,
        budget: Optional[int] = None,
        output: Optional[Callable[[str], object]] = None,
        record: bool = False,
        replay: Optional[_esl.Recording] = None,
    ) -> None:
        self._machine = _esl.Engine(
            clock=clock,
            allow=rights_of(allow),
            memory=size_of(memory),
            seed=seed,
            budget=budget,
            output=output,
            record=record,
            replay=replay,
        )
        self._shared_handle: Optional[_esl.Handle] = None
        self._loop: Optional[Loop] = None
        _engines.add(self)

    @property
    def facts(self) -> Facts:
        """The logical database of the program."""
        return Facts(self)

    @property
    def inputs(self) -> Inputs:
        """The inputs of the program, by their names."""
        return Inputs(self)

    def __del__(self) -> None:
        # Before the collector takes apart what cleanups call.
        try:
            self._machine.end()
        except (AttributeError, RuntimeError, Ended):
            # It was not made, is in a call of another thread, or belongs to another process.
            pass

    # ---- evaluating

    def eval(self, text: str) -> Any:
        """Evaluates the forms of a text and returns the first value of the last; while the engine runs in a loop, an
        awaitable of it."""
        loop = self._running_loop()
        if loop:
            return loop.evaluate(lambda: self._machine.begin(text), lambda error: error_of(error, text))
        return self._machine.eval(text)

    def load(self, path: Union[str, "os.PathLike[str]"]) -> Any:
        """Evaluates a source file, or runs a compiled one (.eslb). Returns the first value of its last form; while the
        engine runs in a loop, an awaitable of it. A load that takes more than a second is shown at a terminal."""
        loop = self._running_loop()
        if loop and not os.fspath(path).endswith(".eslb"):
            return loop.evaluate(lambda: self._machine.begin_load(path), lambda error: error_of_file(error, path))
        with StatusLine(f"loading {os.fspath(path)}"):
            try:
                return self._machine.load(path)
            except (CompileError, Failure) as error:
                refused = error_of_file(error, path)
                if refused is error:
                    raise
                raise refused from None

    def call(self, name: str, *arguments: Any) -> Any:
        """Calls a function of the program and returns its first value; while the engine runs in a loop, an awaitable
        of it. A call that is cancelled aborts its task."""
        if self._loop is not None:
            loop = self._running_loop()
            if loop:
                return loop.call(name, arguments)
        return self._machine.call(name, *arguments)

    # ---- functions of Python

    def function(self, function: F) -> F:
        """Defines a function of the program by a function of Python, whose name, parameters and documentation it
        has: `max_speed` is MAX-SPEED, keyword-only parameters are keywords. An exception is a failure of the call:
        `esl.Failure` with its cause, any other with the cause :PYTHON-ERROR."""
        signature = signature_of(function)

        def call(*values: Any) -> Any:
            positional, keywords = arguments_of(signature, list(values))
            return function(*positional, **keywords)

        called = function if signature.is_plain else call
        self._machine.define(function_name(function), signature.lambda_list, inspect.getdoc(function) or "", called)
        return function

    def operation(self, function: F) -> F:
        """Defines an operation of the program, for which only its task waits.

        An async function runs as a task of the event loop in which the engine runs, and is cancelled when the program
        leaves the call, which waits until it has ended. Any other function runs on a thread of its own.
        """
        signature = signature_of(function)
        is_async = inspect.iscoroutinefunction(function)
        # The machine holds the function, so it must not hold the engine.
        this = weakref.ref(self)

        def begin(operation: _esl.Operation) -> None:
            engine = this()
            if not is_async:
                _begin_in_thread(signature, function, operation)
            elif engine is None:
                operation.drop()
            else:
                engine._begin_in_loop(signature, function, operation)

        self._machine.define_operation(
            function_name(function), signature.lambda_list, inspect.getdoc(function) or "", begin
        )
        return function

    def _begin_in_loop(self, signature: Signature, function: Callable[..., Any], operation: _esl.Operation) -> None:
        loop = self._running_loop()
        if loop is None:
            raise RuntimeError(
                f"`{function.__name__}` is async, so the engine has to run in an event loop: "
                "`async with engine.running():`"
            )
        positional, keywords = arguments_of(signature, operation.arguments)
        loop.perform(operation, function(*positional, **keywords))

    # ---- the program

    def definitions(self, package: str = "esl-user") -> list[Definition]:
        """Returns the definitions of the program in a package, sorted by name: of functions, macros, properties,
        inputs and variables. Those of functions of Python are among them."""
        return [Definition(*row) for row in self._machine.definitions(package)]

    def patch(self, text: str, name: str = "patch") -> int:
        """Makes the definitions of a text in the running program, all at once; none of them if any fails. Calls that
        run keep the code that they have. Returns the number of definitions."""
        return self._machine.patch(name, text)

    def undo_patch(self) -> Optional[int]:
        """Takes the newest patch back. Returns the number of its definitions, or None without a patch."""
        return self._machine.undo_patch()

    def tasks(self) -> Any:
        """Returns the tasks that have not ended, which a notebook shows as a tree; while the engine runs in a loop, an
        awaitable of them."""
        return self._answer(self._handle().tasks(), lambda rows: Tasks(TaskInfo(*row) for row in rows))

    def task_report(self) -> str:
        """Returns a text that shows the tasks of the program."""
        return self._machine.task_report()

    def completions(self, prefix: str) -> list[tuple[str, str]]:
        """Returns the names that begin with a prefix, in lower case, with the first line of their documentation."""
        text = prefix.replace("\\", "\\\\").replace('"', '\\"')
        rows = self._machine.eval(f'(esl::%completions "{text}")')
        return [(name, about) for name, about in rows or []]

    # ---- watching

    def observe(self, function: Callable[[Event], object], kinds: Iterable[str] = ()) -> Subscription:
        """Has a function called with each `Event` of a task of the program, or only with those of these kinds:

            engine.observe(print, kinds=["begins", "fails", "ends"])

        It is called on the thread on which the engine runs, which waits for it, and cannot call the engine.
        """

        def call(time: float, task: int, kind: str, detail: Optional[str]) -> None:
            function(Event(time, task, kind, detail))

        return Subscription(self._machine.observe(call, set(kinds)).stop)

    def timeline(self) -> Timeline:
        """Begins a drawing of the run, which a notebook shows: it ends with its `with` block."""
        return Timeline(self._machine.timeline())

    # ---- recording

    def recording(self) -> _esl.Recording:
        """Returns what was recorded so far, for `esl.Engine(replay=…)`. The engine is one of `esl.Engine(record=True)`."""
        return self._machine.recording()

    @property
    def canary(self) -> int:
        """A hash of the course of the run so far: that of a recorded run and of its replay is the same."""
        return self._machine.canary

    # ---- running

    def handle(self) -> _esl.Handle:
        """Returns a handle, through which other threads reach the run. While there is one, a program waits for what
        may come by it."""
        return self._machine.handle()

    def end(self) -> list[str]:
        """Ends what still runs: aborts all tasks, runs their cleanups, cancels operations. Returns what has not ended
        in time."""
        return self._machine.end()

    @asynccontextmanager
    async def running(self) -> AsyncIterator["Engine"]:
        """Runs the engine in the event loop while the body runs: evaluations and calls are awaitable meanwhile."""
        if self._running_loop():
            raise RuntimeError("the engine runs in an event loop already")
        # Imported here: asyncio takes longer than all the rest of the package.
        from ._loop import Loop

        loop = self._loop = Loop(self._machine)
        try:
            yield self
        finally:
            self._loop = None
            await loop.close()

    def _running_loop(self) -> Optional[Loop]:
        if self._loop is not None and self._loop.is_over:
            self._loop = None
        return self._loop

    def _handle(self) -> _esl.Handle:
        return self._machine.handle()

    def _kept_handle(self) -> _esl.Handle:
        if self._shared_handle is None:
            self._shared_handle = self._machine.handle()
        return self._shared_handle

    def _answer(self, reply: Awaited, read: Callable[[Any], Any] = lambda value: value) -> Any:
        loop = self._running_loop()
        if loop:
            future = loop.answer(reply)
            return _read_later(future, read)
        ending: Optional[BaseException] = None
        while True:
            has_come, value = reply.take()
            if has_come:
                return read(value)
            if ending is not None:
                raise ending
            ending = self._machine.poll(PORTION)[2]


async def _read_later(future: Any, read: Callable[[Any], Any]) -> Any:
    return read(await future)


def function_name(function: Callable[..., Any]) -> str:
    """Returns the name by which a program calls a function of Python."""
    if function.__name__ == "<lambda>":
        raise TypeError("a lambda has no name by which a program can call it: define the function by `def`")
    return program_name(function.__name__)


def _begin_in_thread(signature: Signature, function: Callable[..., Any], operation: _esl.Operation) -> None:
    positional, keywords = arguments_of(signature, operation.arguments)

    def perform() -> None:
        try:
            value = function(*positional, **keywords)
        except BaseException as error:
            operation.fail(error)
            return
        try:
            operation.complete(value)
        except Exception as refused:
            operation.fail(refused)

    run_in_thread(perform)


@atexit.register
def _end_all() -> None:
    """Ends all engines while functions of Python can still be called by cleanups."""
    is_left = False
    for engine in list(_engines):
        try:
            engine.end()
        except Ended:
            pass
        except RuntimeError:
            # It is in a call of another thread, or belongs to another process.
            is_left = True
    _esl.note_exit()
    if is_left:
        # Threads that wait for the interpreter get it once more, and stay where they are from then on.
        time.sleep(0.02)
