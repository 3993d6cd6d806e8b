"""Engines: machines in which programs run."""

from __future__ import annotations

import asyncio
import inspect
from contextlib import asynccontextmanager
from typing import Any, AsyncIterator, Awaitable, Callable, Iterable, Optional, TypeVar

from . import _esl
from .errors import Ended

F = TypeVar("F", bound=Callable[..., Any])

# Ticks after which a loop lets its other tasks run.
_PORTION = 100_000


def _lambda_list(function: Callable[..., Any]) -> tuple[str, list[tuple[str, bool, Any]]]:
    """Returns the lambda list of a function, and for each variable its name, whether it is a keyword, its default."""
    required: list[str] = []
    optional: list[str] = []
    keys: list[str] = []
    variables: list[tuple[str, bool, Any]] = []
    for parameter in inspect.signature(function).parameters.values():
        name = parameter.name.replace("_", "-")
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            raise TypeError(f"a function of a program has no parameter `*{parameter.name}`: name its arguments")
        is_keyword = parameter.kind is parameter.KEYWORD_ONLY
        if is_keyword:
            keys.append(name)
        elif parameter.default is parameter.empty:
            required.append(name)
        else:
            optional.append(name)
        variables.append((parameter.name, is_keyword, parameter.default))
    # Whether an argument was given is asked of its variable, so that defaults are those of Python.
    parts = required
    if optional:
        parts = parts + ["&optional"] + [f"({name} :%not-given)" for name in optional]
    if keys:
        parts = parts + ["&key"] + [f"({name} :%not-given)" for name in keys]
    return f"({' '.join(parts)})", variables


def _arguments(variables: list[tuple[str, bool, Any]], values: list[Any]) -> tuple[list[Any], dict[str, Any]]:
    from .values import Keyword

    not_given = Keyword("%not-given")
    positional: list[Any] = []
    keywords: dict[str, Any] = {}
    for (name, is_keyword, default), value in zip(variables, values):
        if value == not_given:
            if default is inspect.Parameter.empty:
                raise TypeError(f"the keyword argument `{name}` is missing")
            value = default
        if is_keyword:
            keywords[name] = value
        else:
            positional.append(value)
    return positional, keywords


class Facts:
    """The logical database of a program."""

    def __init__(self, engine: "Engine") -> None:
        self._engine = engine

    def assert_(self, fact: Any) -> Any:
        """Adds a fact, a text or a value. Returns whether it is new."""
        return self._engine._answer(self._engine._handle().assert_fact(fact))

    def retract(self, pattern: Any) -> Any:
        """Removes the facts that match a pattern. Returns how many there were."""
        return self._engine._answer(self._engine._handle().retract(pattern))

    def query(self, query: Any) -> Any:
        """Returns the answers to a query such as "(at ?robot ?place)": dictionaries of its variables."""
        return self._engine._answer(self._engine._handle().query(query))


class Input:
    """An input of a program. Its signals come from any thread."""

    def __init__(self, handle: _esl.Handle, name: str) -> None:
        self._handle = handle
        self.name = name

    def signal(self, *arguments: Any) -> None:
        """Signals the input. Waits while it is full, if that is its rule."""
        self._handle.signal(self.name, *arguments)

    def try_signal(self, *arguments: Any) -> None:
        """Signals the input, and raises `Full` instead of waiting."""
        self._handle.try_signal(self.name, *arguments)


class Inputs:
    """The inputs of a program, by their names: engine.inputs["scan"]. They keep the program waiting for signals."""

    def __init__(self, engine: "Engine") -> None:
        self._engine = engine

    def __getitem__(self, name: str) -> Input:
        return Input(self._engine._kept_handle(), name)


class Engine:
    """A machine with the library of ESL. Definitions last from one evaluation to the next.

    `clock` is "real" or "virtual"; `allow` lists rights as the options --allow-… have them: "net=127.0.0.1:1883";
    `memory` is a number of bytes or a text such as "64M". An engine serves one thread at a time; other threads reach
    it by `handle()` and `inputs`.
    """

    def __init__(
        self,
        *,
        clock: str = "real",
        allow: Iterable[str] = (),
        memory: Optional[int | str] = None,
        seed: int = 0,
        budget: Optional[int] = None,
    ) -> None:
        if isinstance(memory, str):
            units = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}
            digits, unit = (memory[:-1], memory[-1].upper()) if memory[-1:].upper() in units else (memory, "")
            if not digits.isdigit():
                raise ValueError(f"`{memory}` is not a size: expected a number, optionally followed by K, M or G")
            memory = int(digits) * units.get(unit, 1)
        self._machine = _esl.Engine(clock=clock, allow=list(allow), memory=memory, seed=seed, budget=budget)
        self._shared_handle: Optional[_esl.Handle] = None
        self._loop: Optional["_Loop"] = None
        self.facts = Facts(self)
        self.inputs = Inputs(self)

    def eval(self, text: str) -> Any:
        """Evaluates the forms of a text and returns the first value of the last; while the engine runs in a loop, an
        awaitable of it."""
        if self._loop:
            return self._loop.answer(self._machine.begin(text))
        return self._machine.eval(text)

    def load(self, path: Any) -> Any:
        """Evaluates a source file, or runs a compiled one (.eslb). Returns the first value of its last form."""
        return self._machine.load(path)

    def call(self, name: str, *arguments: Any) -> Any:
        """Calls a function of the program and returns its first value; while the engine runs in a loop, an awaitable
        of it. A call that is cancelled aborts its task."""
        if self._loop:
            return self._loop.call(name, arguments)
        return self._machine.call(name, *arguments)

    def function(self, function: F) -> F:
        """Defines a function of the program by a function of Python, whose name, parameters and documentation it
        has: `max_speed` is MAX-SPEED, keyword-only parameters are keywords. An exception is a failure of the call:
        `esl.Failure` with its cause, any other with the cause :PYTHON-ERROR."""
        lambda_list, variables = _lambda_list(function)

        def call(*values: Any) -> Any:
            positional, keywords = _arguments(variables, list(values))
            return function(*positional, **keywords)

        self._machine.define(_name(function), lambda_list, inspect.getdoc(function) or "", call)
        return function

    def operation(self, function: F) -> F:
        """Defines an operation of the program, for which only its task waits.

        An async function runs as a task of the event loop in which the engine runs, and is cancelled when the program
        leaves the call, which waits until it has ended. Any other function runs on a thread of its own.
        """
        lambda_list, variables = _lambda_list(function)
        is_async = inspect.iscoroutinefunction(function)

        def begin(operation: _esl.Operation) -> None:
            positional, keywords = _arguments(variables, operation.arguments)
            if is_async:
                if self._loop is None:
                    raise RuntimeError(
                        f"`{function.__name__}` is async, so the engine has to run in an event loop: "
                        "`async with engine.running():`"
                    )
                self._loop.perform(operation, function(*positional, **keywords))
            else:
                import threading

                thread = threading.Thread(
                    target=_perform, args=(operation, function, positional, keywords), daemon=True
                )
                thread.start()

        self._machine.define_operation(_name(function), lambda_list, inspect.getdoc(function) or "", begin)
        return function

    def handle(self) -> _esl.Handle:
        """Returns a handle, through which other threads reach the run. While there is one, a program waits for what
        may come by it."""
        return self._machine.handle()

    def end(self) -> list[str]:
        """Ends what still runs: aborts all tasks, runs their cleanups, cancels operations."""
        return self._machine.end()

    def task_report(self) -> str:
        """Returns a text that shows the tasks of the program."""
        return self._machine.task_report()

    @asynccontextmanager
    async def running(self) -> AsyncIterator["Engine"]:
        """Runs the engine in the event loop while the body runs: evaluations and calls are awaitable meanwhile."""
        if self._loop:
            raise RuntimeError("the engine runs in an event loop already")
        self._loop = _Loop(self._machine)
        try:
            yield self
        finally:
            loop, self._loop = self._loop, None
            await loop.close()

    def _handle(self) -> _esl.Handle:
        return self._machine.handle()

    def _kept_handle(self) -> _esl.Handle:
        if self._shared_handle is None:
            self._shared_handle = self._machine.handle()
        return self._shared_handle

    def _answer(self, reply: _esl.Reply) -> Any:
        if self._loop:
            return self._loop.answer(reply)
        while True:
            has_come, value = reply.take()
            if has_come:
                return value
            self._machine.poll(_PORTION)


def _name(function: Callable[..., Any]) -> str:
    return function.__name__.replace("_", "-")


def _perform(operation: _esl.Operation, function: Callable[..., Any], positional: list[Any], keywords: dict[str, Any]) -> None:
    try:
        value = function(*positional, **keywords)
    except BaseException as error:
        operation.fail(error)
    else:
        operation.complete(value)


class _Loop:
    """An engine that runs in an event loop: polled when it has something to do, or somebody waits for an answer."""

    def __init__(self, machine: _esl.Engine) -> None:
        self._machine = machine
        self._loop = asyncio.get_running_loop()
        # While it runs in a loop, anything may come.
        self._handle = machine.handle()
        self._waiting: list[tuple[_esl.Reply | _esl.Task, asyncio.Future[Any]]] = []
        self._tasks: set[asyncio.Task[Any]] = set()
        self._timer: Optional[asyncio.TimerHandle] = None
        self._is_scheduled = False
        self._is_closed = False
        self._wakeup = machine.wakeup_fd()
        self._loop.add_reader(self._wakeup, self._schedule)
        self._schedule()

    def _schedule(self) -> None:
        if not self._is_scheduled and not self._is_closed:
            self._is_scheduled = True
            self._loop.call_soon(self._step)

    def _step(self) -> None:
        self._is_scheduled = False
        if self._is_closed:
            return
        if self._timer:
            self._timer.cancel()
            self._timer = None
        is_busy, wait, _ = self._machine.poll(_PORTION)
        self._take_answers()
        if is_busy:
            self._schedule()
            return
        if wait is not None:
            self._timer = self._loop.call_later(wait, self._schedule)
        self._machine.watch_wakeup()

    def _take_answers(self) -> None:
        waiting, self._waiting = self._waiting, []
        for reply, future in waiting:
            if future.done():
                continue
            try:
                has_come, value = reply.take()
            except BaseException as error:
                future.set_exception(error)
            else:
                if has_come:
                    future.set_result(value)
                else:
                    self._waiting.append((reply, future))

    def answer(self, reply: _esl.Reply | _esl.Task) -> asyncio.Future[Any]:
        future: asyncio.Future[Any] = self._loop.create_future()
        self._waiting.append((reply, future))
        self._schedule()
        return future

    def call(self, name: str, arguments: tuple[Any, ...]) -> asyncio.Future[Any]:
        task = self._handle.spawn(name, *arguments)
        future = self.answer(task)

        def ended(future: asyncio.Future[Any]) -> None:
            if future.cancelled():
                task.abort()
                self._schedule()

        future.add_done_callback(ended)
        return future

    def perform(self, operation: _esl.Operation, coroutine: Awaitable[Any]) -> None:
        task = asyncio.ensure_future(coroutine, loop=self._loop)
        self._tasks.add(task)

        def ended(task: asyncio.Task[Any]) -> None:
            self._tasks.discard(task)
            if task.cancelled():
                operation.drop()
            elif task.exception() is not None:
                operation.fail(task.exception())
            else:
                try:
                    operation.complete(task.result())
                except Exception as error:
                    operation.fail(error)

        task.add_done_callback(ended)
        operation.on_cancel(lambda: self._loop.call_soon_threadsafe(task.cancel))

    async def close(self) -> None:
        """Leaves the engine as it is; what waits for an answer fails with `Ended`."""
        self._is_closed = True
        self._loop.remove_reader(self._wakeup)
        if self._timer:
            self._timer.cancel()
        for _, future in self._waiting:
            if not future.done():
                future.set_exception(Ended("the engine does not run in the event loop any more"))
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
