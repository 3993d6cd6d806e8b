"""Durable runs: killed at any place, they go on in the next process where they were."""

from __future__ import annotations

import asyncio
import contextvars
import inspect
import os
from pathlib import Path
from typing import Any, Callable, Iterable, NamedTuple, Optional, TypeVar, Union, overload

from . import _esl
from ._diagnosis import error_of, error_of_file
from ._signature import Signature, arguments_of, signature_of
from ._workers import run_in_thread
from .engine import Size, function_name, rights_of, size_of
from .errors import CompileError, Failure, NotDurable

F = TypeVar("F", bound=Callable[..., Any])

_operation: "contextvars.ContextVar[_esl.Operation]" = contextvars.ContextVar("esl_operation")


def _current() -> _esl.Operation:
    try:
        return _operation.get()
    except LookupError:
        raise RuntimeError("no operation of a durable run is under way here") from None


def save(state: bytes) -> None:
    """Keeps bytes with the state of the durable run, for the operation that calls this, in place of those that it
    has saved before. Returns when they are as safe as the run demands. If its process dies, the next one begins the
    operation again, and `restore()` returns the bytes there. Raises `NotDurable` if they cannot be kept: then the
    operation does not go on."""
    if not _current().save(bytes(state)):
        raise NotDurable("the state of the operation cannot be kept")


def restore() -> Optional[bytes]:
    """Returns the bytes that the operation which calls this has saved last, in this process or an earlier one."""
    return _current().restore()


def action() -> str:
    """Returns the identity of the call that the operation which calls this performs, 32 hexadecimal digits: the same
    in each process that performs it. A service that knows such keys performs the call once."""
    return _current().action or ""


class Resumed(NamedTuple):
    """A run that goes on: the number of its process, from 2, and the seconds since the last record of the one
    before."""

    process: int
    downtime: float


class DurableEngine:
    """A program whose state is kept in a folder. Killed at any place, it goes on there in the next process, which
    makes the same engine again:

        rover = esl.DurableEngine("rover.state", "rover.esl")

        @rover.operation
        def drive(metres):
            done = int.from_bytes(esl.restore() or b"", "big")
            while done < metres:
                wheels.turn_to(done + 1)
                done += 1
                esl.save(done.to_bytes(4, "big"))

        status = rover.run()

    A call that the end of a process has interrupted is made again if its function is `idempotent`, or if its
    operation has saved bytes by `esl.save`. Any other one fails with :interrupted-by-restart, which the program handles.

    :param folder: the folder, which is made if there is none
    :param path: the source file of the program; modules beside it are found
    :param text: the program itself, in place of a file
    :param durability: "process", or "power": it survives loss of power too, and waits for the disk before each effect
    :param downtime: "counts", or "stops": the program's clock has stood still between two processes
    :param snapshot_every: when the machine is stored: "60s", "64M", "never"
    :param upgrade: makes the definitions of another version of the program, if it has changed
    :param from_facts: begins the run of another version of this package anew, with its facts and the variables of DEFDURABLE

    The other parameters are those of `Engine`; limits and seed are the same in each process.
    """

    def __init__(
        self,
        folder: Union[str, "os.PathLike[str]"],
        path: Union[str, "os.PathLike[str]", None] = None,
        *,
        text: Optional[str] = None,
        clock: str = "real",
        allow: Iterable[str] = (),
        memory: Optional[Size] = None,
        seed: int = 0,
        budget: Optional[int] = None,
        output: Optional[Callable[[str], object]] = None,
        durability: str = "process",
        downtime: str = "counts",
        snapshot_every: Optional[str] = None,
        upgrade: bool = False,
        from_facts: bool = False,
    ) -> None:
        if (path is None) == (text is None):
            raise TypeError("a durable run has its program in a file or as a text: name one of them")
        self._folder = folder
        self._path = path
        self._text = text
        self._settings = (clock, rights_of(allow), size_of(memory), seed, budget, output)
        self._durable = (durability, downtime, snapshot_every, upgrade, from_facts)
        self._rows: list[tuple[str, str, str, Callable[..., Any], bool, bool]] = []
        self._run: Optional[_esl.DurableEngine] = None
        self._loop: Optional[asyncio.AbstractEventLoop] = None
        self._tasks: "set[asyncio.Task[Any]]" = set()
        self._async_function: Optional[Callable[..., Any]] = None
        self._early: list[tuple[Signature, Callable[..., Any], _esl.Operation]] = []

    # ---- functions of Python

    @overload
    def function(self, function: F) -> F: ...
    @overload
    def function(self, *, idempotent: bool = False) -> Callable[[F], F]: ...
    def function(self, function: Optional[F] = None, *, idempotent: bool = False) -> Any:
        """Defines a function of the program, as `Engine.function`, before the run begins: the same ones in each
        process."""
        if function is None:
            return lambda function: self._define_function(function, idempotent)
        return self._define_function(function, idempotent)

    def _define_function(self, function: F, idempotent: bool) -> F:
        signature = signature_of(function)

        def call(*values: Any) -> Any:
            positional, keywords = arguments_of(signature, list(values))
            return function(*positional, **keywords)

        self._add(function, signature, function if signature.is_plain else call, False, idempotent)
        return function

    @overload
    def operation(self, function: F) -> F: ...
    @overload
    def operation(self, *, idempotent: bool = False) -> Callable[[F], F]: ...
    def operation(self, function: Optional[F] = None, *, idempotent: bool = False) -> Any:
        """Defines an operation of the program, as `Engine.operation`, before the run begins. It may call `esl.save`,
        `esl.restore` and `esl.action`."""
        if function is None:
            return lambda function: self._define_operation(function, idempotent)
        return self._define_operation(function, idempotent)

    def _define_operation(self, function: F, idempotent: bool) -> F:
        signature = signature_of(function)
        if inspect.iscoroutinefunction(function):
            self._async_function = function

            def begin(operation: _esl.Operation) -> None:
                self._begin_in_loop(signature, function, operation)

        else:

            def begin(operation: _esl.Operation) -> None:
                _begin_in_thread(signature, function, operation)

        self._add(function, signature, begin, True, idempotent)
        return function

    def _add(
        self,
        function: Callable[..., Any],
        signature: Signature,
        called: Callable[..., Any],
        is_operation: bool,
        idempotent: bool,
    ) -> None:
        if self._run is not None:
            raise RuntimeError("the run is open: define its functions before")
        name, documentation = function_name(function), inspect.getdoc(function) or ""
        self._rows.append((name, signature.lambda_list, documentation, called, is_operation, idempotent))

    def _begin_in_loop(self, signature: Signature, function: Callable[..., Any], operation: _esl.Operation) -> None:
        if self._run is None:
            # It was under way in an earlier process, and goes on when the run does.
            self._early.append((signature, function, operation))
            return
        loop = self._loop
        if loop is None:
            raise RuntimeError(_needs_loop(function))
        positional, keywords = arguments_of(signature, operation.arguments)

        async def perform() -> Any:
            _operation.set(operation)
            return await function(*positional, **keywords)

        def ended(task: "asyncio.Task[Any]") -> None:
            self._tasks.discard(task)
            if task.cancelled():
                operation.drop()
            elif (error := task.exception()) is not None:
                operation.fail(error)
            else:
                _complete(operation, task.result())

        def begin() -> None:
            task = loop.create_task(perform())
            self._tasks.add(task)
            task.add_done_callback(ended)
            # The program waits until the task has ended.
            operation.on_cancel(lambda: _call_in(loop, task.cancel))

        _call_in(loop, begin)

    # ---- running

    def open(self) -> "DurableEngine":
        """Compiles the program, and takes the folder: begins the run, or goes on with it. Nothing runs yet. Raises
        `NotDurable` if another process has the folder, or it is damaged, or has the run of another program."""
        if self._run is not None:
            return self
        name, text = ("<text>", self._text)
        if text is None:
            assert self._path is not None
            name, text = str(self._path), Path(self._path).read_text(encoding="utf-8")
        path = None if self._path is None else Path(self._path)
        try:
            self._run = _esl.DurableEngine(
                self._folder, (name, text), path, self._rows, *self._settings, *self._durable
            )
        except (CompileError, Failure) as error:
            raise (error_of(error, text) if self._path is None else error_of_file(error, self._path)) from None
        return self

    def handle(self) -> _esl.Handle:
        """Returns a handle, through which other threads reach the run, before `run`. While there is one, a program waits
        for what may come by it."""
        self.open()
        assert self._run is not None
        return self._run.handle()

    def run(self) -> Optional[int]:
        """Runs the program until it ends or is paused. Returns its exit status; None if it is paused: then the next
        process goes on. Ctrl-C pauses it, and raises `KeyboardInterrupt`."""
        self.open()
        assert self._run is not None
        if self._async_function is not None and self._loop is None:
            raise RuntimeError(_needs_loop(self._async_function))
        return self._run.run()

    async def run_async(self) -> Optional[int]:
        """As `run`, while async operations run as tasks of the event loop. If it is cancelled, the run is paused."""
        self.open()
        self._loop = asyncio.get_running_loop()
        early, self._early = self._early, []
        for operation in early:
            self._begin_in_loop(*operation)
        running = self._loop.run_in_executor(None, self.run)
        try:
            return await asyncio.shield(running)
        except asyncio.CancelledError:
            self.pause()
            await asyncio.wait([running])
            raise
        finally:
            self._loop = None
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def pause(self) -> None:
        """Has `run` leave the run, so that it goes on in the next process. From any thread."""
        if self._run is not None:
            self._run.pause()

    @property
    def resumed(self) -> Optional[Resumed]:
        """How the run goes on in this process; None for a new run, and until its journal is repeated."""
        found = self._run.resumed if self._run is not None else None
        return None if found is None else Resumed(*found)


def _needs_loop(function: Callable[..., Any]) -> str:
    return f"`{function.__name__}` is async, so the run needs an event loop: `await engine.run_async()`"


def _call_in(loop: asyncio.AbstractEventLoop, function: Callable[[], object]) -> None:
    try:
        loop.call_soon_threadsafe(function)
    except RuntimeError:
        # A loop that is closed runs nothing any more.
        pass


def _complete(operation: _esl.Operation, value: Any) -> None:
    try:
        operation.complete(value)
    except Exception as refused:
        operation.fail(refused)


def _begin_in_thread(signature: Signature, function: Callable[..., Any], operation: _esl.Operation) -> None:
    positional, keywords = arguments_of(signature, operation.arguments)

    def perform() -> None:
        token = _operation.set(operation)
        try:
            value = function(*positional, **keywords)
        except BaseException as error:
            operation.fail(error)
        else:
            _complete(operation, value)
        finally:
            _operation.reset(token)

    run_in_thread(perform)
