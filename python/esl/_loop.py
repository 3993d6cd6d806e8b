"""Engines in event loops of asyncio."""

from __future__ import annotations

import asyncio
from typing import Any, Callable, Coroutine, Optional, Union

from . import _esl
from .engine import PORTION
from .errors import Ended

Awaited = Union[_esl.Reply, _esl.Task]
# Returns the error to be raised for one that has come.
Diagnose = Callable[[BaseException], BaseException]


def _as_it_is(error: BaseException) -> BaseException:
    return error


class Loop:
    """An engine that runs in an event loop: polled when it has something to do, or somebody waits for an answer."""

    def __init__(self, machine: _esl.Engine) -> None:
        self._machine = machine
        self.loop = asyncio.get_running_loop()
        # While it runs in a loop, anything may come.
        self._handle = machine.handle()
        # What is waited for by number, and the numbers of the answers that have come.
        self._waiting: dict[int, tuple[Awaited, asyncio.Future[Any], Diagnose]] = {}
        self._mailbox = _esl.Mailbox()
        self._count = 0
        self._tasks: set[asyncio.Task[Any]] = set()
        self._timer: Optional[asyncio.TimerHandle] = None
        self._is_scheduled = False
        self._is_closed = False
        self._wakeup = machine.wakeup_fd()
        self.loop.add_reader(self._wakeup, self._schedule)
        self._schedule()

    @property
    def is_over(self) -> bool:
        """Whether the engine runs here no more: it has left the loop, or the loop is closed."""
        return self._is_closed or self.loop.is_closed()

    def check(self) -> None:
        """Refuses a use from anywhere but the thread of the loop."""
        try:
            here: Optional[asyncio.AbstractEventLoop] = asyncio.get_running_loop()
        except RuntimeError:
            here = None
        if here is not self.loop:
            raise RuntimeError(
                "the engine runs in an event loop: await the call there, use `asyncio.run_coroutine_threadsafe`, or "
                "reach the engine by `handle()`"
            )

    def _schedule(self) -> None:
        if not self._is_scheduled and not self._is_closed:
            self._is_scheduled = True
            self.loop.call_soon(self._step)

    def _step(self) -> None:
        self._is_scheduled = False
        if self._is_closed:
            return
        if self._timer:
            self._timer.cancel()
            self._timer = None
        is_busy, wait, ending = self._machine.poll(PORTION)
        self._take_answers()
        if ending is not None:
            self._fail_all(ending)
        if is_busy:
            self._schedule()
            return
        if wait is not None:
            self._timer = self.loop.call_later(wait, self._schedule)
        self._machine.watch_wakeup()

    def _take_answers(self) -> None:
        for number in self._mailbox.take():
            if number not in self._waiting:
                continue
            reply, future, diagnose = self._waiting.pop(number)
            # A future that was cancelled takes no answer.
            if future.done():
                continue
            try:
                value = reply.take()[1]
            except BaseException as error:
                future.set_exception(diagnose(error))
            else:
                future.set_result(value)

    def _fail_all(self, error: BaseException) -> None:
        waiting, self._waiting = self._waiting, {}
        for _, future, _ in waiting.values():
            if not future.done():
                future.set_exception(error)

    def answer(self, reply: Awaited, diagnose: Diagnose = _as_it_is) -> asyncio.Future[Any]:
        """Returns the future of an answer."""
        self.check()
        future: asyncio.Future[Any] = self.loop.create_future()
        self._count += 1
        self._waiting[self._count] = (reply, future, diagnose)
        reply.notify(self._mailbox, self._count)
        self._schedule()
        return future

    def _answer_of_task(self, task: _esl.Task, diagnose: Diagnose) -> asyncio.Future[Any]:
        future = self.answer(task, diagnose)

        def ended(future: asyncio.Future[Any]) -> None:
            if future.cancelled():
                task.abort()
                if not self.loop.is_closed():
                    self._schedule()

        future.add_done_callback(ended)
        return future

    def evaluate(self, begin: Callable[[], _esl.Task], diagnose: Diagnose) -> asyncio.Future[Any]:
        """Returns the future of an evaluation, which aborts its task when it is cancelled."""
        self.check()
        return self._answer_of_task(begin(), diagnose)

    def call(self, name: str, arguments: tuple[Any, ...]) -> asyncio.Future[Any]:
        """Returns the future of a call, which aborts its task when it is cancelled."""
        self.check()
        return self._answer_of_task(self._handle.spawn(name, *arguments), _as_it_is)

    def perform(self, operation: _esl.Operation, coroutine: Coroutine[Any, Any, Any]) -> None:
        """Performs an operation by a task of the loop, which is cancelled when the program leaves the call."""
        task = self.loop.create_task(coroutine)
        self._tasks.add(task)

        def ended(task: asyncio.Task[Any]) -> None:
            self._tasks.discard(task)
            # The machine is polled below, so its end of the operation need not wake the loop.
            if not self._is_closed:
                self._machine.unwatch_wakeup()
            if task.cancelled():
                operation.drop()
            elif (error := task.exception()) is not None:
                operation.fail(error)
            else:
                try:
                    operation.complete(task.result())
                except Exception as refused:
                    operation.fail(refused)
            # The task of the program goes on at once, unless others are about to end too.
            if self._tasks:
                self._schedule()
            else:
                self._step()

        def cancel() -> None:
            try:
                self.loop.call_soon_threadsafe(task.cancel)
            except RuntimeError:
                # A loop that is closed runs no task, so nothing moves any more.
                operation.drop()

        task.add_done_callback(ended)
        operation.on_cancel(cancel)

    async def close(self) -> None:
        """Leaves the engine as it is; what waits for an answer fails with `Ended`."""
        self._is_closed = True
        self.loop.remove_reader(self._wakeup)
        if self._timer:
            self._timer.cancel()
        self._fail_all(Ended("the engine does not run in the event loop any more"))
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
