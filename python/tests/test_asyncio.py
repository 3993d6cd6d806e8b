"""Engines in an event loop: awaitable calls, async operations, and what others have stumbled over."""

import asyncio
import gc

import pytest

import esl


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, 20))


def test_operations_are_tasks_of_the_loop():
    engine = esl.Engine()

    @engine.operation
    async def drive(metres: float, *, speed: float = 1.0) -> float:
        await asyncio.sleep(0.001)
        if metres > 10:
            raise esl.Failure("obstacle", [7])
        return metres / speed

    async def main():
        async with engine.running():
            engine.eval("(defun survey (n) (loop for i from 1 to n sum (drive i :speed 2)))")
            assert await engine.call("survey", 4) == 5.0
            # Others of the loop go on meanwhile.
            both = await asyncio.gather(engine.call("drive", 3), engine.call("drive", 4))
            assert both == [3.0, 4.0]
            with pytest.raises(esl.Failure, match="(?i)obstacle"):
                await engine.call("drive", 50)

    run(main())


def test_leaving_a_call_cancels_the_operation_and_waits_for_its_end():
    engine = esl.Engine()
    course = []

    @engine.operation
    async def turn():
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            await asyncio.sleep(0.01)
            course.append("stopped")
            raise

    @engine.function
    def note(text):
        course.append(text)

    async def main():
        async with engine.running():
            value = await engine.eval(
                '(handler-case (with-timeout 0.02 (turn)) (failure (f) (note "left") (failure-cause f)))'
            )
            assert value == esl.Keyword("timeout")

    run(main())
    assert course == ["stopped", "left"]


def test_a_cancelled_call_aborts_its_task():
    engine = esl.Engine()
    ended = []

    @engine.function
    def motors_off():
        ended.append(True)

    async def main():
        async with engine.running():
            await engine.eval("(defun patrol () (unwind-protect (loop (sleep 0.001)) (motors-off)))")
            patrol = asyncio.ensure_future(engine.call("patrol"))
            await asyncio.sleep(0.02)
            patrol.cancel()
            with pytest.raises(asyncio.CancelledError):
                await patrol
            while not ended:
                await asyncio.sleep(0.001)
            assert await engine.eval("(+ 1 2)") == 3

    run(main())
    assert ended == [True]


def test_a_future_that_nobody_awaits_does_no_harm():
    engine = esl.Engine()

    async def main():
        async with engine.running():
            for _ in range(100):
                asyncio.ensure_future(engine.call("list", 1))
            gc.collect()
            assert await engine.eval("(+ 1 2)") == 3

    run(main())


def test_an_operation_outlives_its_loop():
    engine = esl.Engine()
    pending = []

    @engine.operation
    async def wait():
        pending.append(True)
        await asyncio.sleep(60)

    async def main():
        async with engine.running():
            task = asyncio.ensure_future(engine.eval("(wait)"))
            while not pending:
                await asyncio.sleep(0.001)
        with pytest.raises(esl.Ended):
            await task

    run(main())
    assert engine.end() == []
    with pytest.raises(RuntimeError, match="engine.running"):
        engine.eval("(wait)")


def test_a_thousand_operations_at_a_time():
    engine = esl.Engine()

    @engine.operation
    async def echo(number):
        await asyncio.sleep(0)
        return number

    async def main():
        async with engine.running():
            numbers = await asyncio.gather(*(engine.call("echo", number) for number in range(1000)))
            assert numbers == list(range(1000))

    run(main())
