"""Where other bindings between Rust and asyncio have stumbled, each as a test."""

import asyncio
import gc
import weakref

import pytest

import esl


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, 20))


def watch_the_loop():
    # Contexts of exceptions that the loop was told of.
    contexts = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: contexts.append(context))
    return contexts


def test_a_future_is_cancelled_before_its_answer_comes():
    engine = esl.Engine()

    async def main():
        contexts = watch_the_loop()
        async with engine.running():
            await engine.eval("(defun quick (n) n)")
            for _ in range(200):
                future = engine.call("quick", 1)
                # In one step the engine answers, in the other order the future is cancelled.
                asyncio.get_running_loop().call_soon(future.cancel)
            futures = [engine.eval("(+ 1 2)") for _ in range(100)]
            for future in futures[::2]:
                future.cancel()
            done = await asyncio.gather(*futures, return_exceptions=True)
            assert [value for value in done if value == 3] == [3] * 50
            assert all(isinstance(value, asyncio.CancelledError) for value in done[::2])
        assert contexts == []

    run(main())


def test_cancelled_in_python_is_aborted_in_the_program():
    engine = esl.Engine()
    course = []

    @engine.function
    def note(text):
        course.append(text)

    @engine.operation
    async def drive():
        try:
            await asyncio.sleep(60)
        finally:
            course.append("stopped")

    async def main():
        async with engine.running():
            await engine.eval('(defun mission () (unwind-protect (drive) (note "cleaned up")))')
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(engine.call("mission"), 0.05)
            while len(course) < 2:
                await asyncio.sleep(0.001)
            # Nothing of it runs on.
            assert await engine.tasks() == []

    run(main())
    assert course == ["stopped", "cleaned up"]


def test_an_evaluation_that_is_cancelled_is_aborted_too():
    engine = esl.Engine()
    ended = []

    @engine.function
    def motors_off():
        ended.append(True)

    async def main():
        async with engine.running():
            patrol = engine.eval("(unwind-protect (loop (sleep 0.001)) (motors-off))")
            await asyncio.sleep(0.02)
            patrol.cancel()
            while not ended:
                await asyncio.sleep(0.001)

    run(main())


def test_completion_after_the_loop_is_closed():
    engine = esl.Engine()
    pending = []
    engine._machine.define_operation("WAIT", "()", "", pending.append)

    @engine.operation
    async def drive():
        await asyncio.sleep(60)

    async def leave_at_once():
        # The context is never left: the loop is closed below it.
        context = engine.running()
        await context.__aenter__()
        asyncio.ensure_future(engine.eval("(list (wait))"))
        engine.eval("(drive)")
        while not pending:
            await asyncio.sleep(0.001)
        return context

    loop = asyncio.new_event_loop()
    context = loop.run_until_complete(leave_at_once())
    loop.close()
    pending[0].complete(5)
    assert engine.eval("(+ 1 2)") == 3, "the engine runs without a loop"
    assert engine.end() == []

    async def again():
        async with engine.running():
            return await engine.eval("(+ 3 4)")

    assert run(again()) == 7
    del context


def test_a_future_is_collected_without_having_been_awaited():
    engine = esl.Engine()

    async def main():
        contexts = watch_the_loop()
        async with engine.running():
            futures = [weakref.ref(engine.call("list", number)) for number in range(100)]
            assert await engine.eval("(+ 1 2)") == 3
            gc.collect()
            assert [future() for future in futures] == [None] * 100, "answers that have come are let go"
            lost = weakref.ref(engine.call("fail", esl.Keyword("lost")))
            await engine.eval("(sleep 0.01)")
            gc.collect()
            assert lost() is None
        # asyncio says that nobody has looked at the failure, as for every future.
        assert [str(context["exception"]) for context in contexts] == [str(contexts[0]["exception"])]
        assert "LOST" in str(contexts[0]["exception"]).upper()

    run(main())


def test_a_panic_does_not_leave_a_task_waiting():
    engine = esl.Engine()

    class Panic(BaseException):
        """As PyO3 has them: not an Exception."""

    @engine.operation
    async def drive():
        raise Panic("a bug")

    @engine.operation
    def lift():
        raise Panic("another bug")

    @engine.function
    def look():
        raise Panic("a third bug")

    async def main():
        async with engine.running():
            for name in ["drive", "lift", "look"]:
                with pytest.raises(Panic, match="bug"):
                    await asyncio.wait_for(engine.call(name), 10)
            assert await engine.eval("(handler-case (drive) (failure (f) (failure-cause f)))") == esl.Keyword(
                "python-error"
            )

    run(main())


def test_an_operation_that_is_lost_does_not_leave_a_task_waiting():
    engine = esl.Engine()
    engine._machine.define_operation("DRIVE", "()", "", lambda operation: None)

    async def main():
        async with engine.running():
            with pytest.raises(esl.Failure) as raised:
                await asyncio.wait_for(engine.call("drive"), 10)
            assert raised.value.cause == ":OPERATION-DROPPED"

    run(main())


def test_the_exit_of_an_operation_ends_the_loop():
    engine = esl.Engine()

    @engine.operation
    async def drive():
        raise SystemExit(3)

    async def main():
        async with engine.running():
            await engine.call("drive")

    with pytest.raises(SystemExit):
        run(main())
    assert engine.eval("(+ 1 2)") == 3


def test_a_call_from_another_thread_than_the_loop_is_refused():
    engine = esl.Engine()

    async def main():
        async with engine.running():
            for use in [lambda: engine.eval("1"), lambda: engine.call("list"), engine.tasks]:
                with pytest.raises(RuntimeError, match="run_coroutine_threadsafe"):
                    await asyncio.to_thread(use)
            with pytest.raises(RuntimeError, match="already"):
                async with engine.running():
                    pass

    run(main())


def test_a_run_that_ends_early_does_not_leave_a_task_waiting():
    engine = esl.Engine(budget=2_000_000)

    async def main():
        async with engine.running():
            assert await engine.eval("(+ 1 2)") == 3
            with pytest.raises(esl.BudgetSpent):
                await engine.eval("(loop)")
            with pytest.raises(esl.BudgetSpent):
                await engine.tasks()

    run(main())
    with pytest.raises(esl.BudgetSpent):
        engine.facts.query("(at ?x)")
