"""The rows that are measured in Python: prints a line of JSON, figures by name, in nanoseconds unless the name says
otherwise."""

import asyncio
import json
import sys
import threading
import time

import esl

CALLS = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000


def best(function, count, rounds=5):
    """Returns the nanoseconds of one of `count` things that a function does, in the best round."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter_ns()
        function(count)
        times.append((time.perf_counter_ns() - start) / count)
    return min(times)


def calls():
    engine = esl.Engine()

    @engine.function
    def increment(n):
        return n + 1

    engine.eval("(defun twice-more (n) (+ 1 (increment n)))")
    call = engine.call

    def run(count):
        n = 0
        for _ in range(count):
            n = call("twice-more", n)
        assert n == 2 * count

    return best(run, CALLS)


def calls_of_lupa():
    import lupa.lua54 as lupa

    lua = lupa.LuaRuntime()
    lua.globals().increment = lambda n: n + 1
    lua.execute("function twice_more(n) return 1 + increment(n) end")
    twice_more = lua.globals().twice_more

    def run(count):
        n = 0
        for _ in range(count):
            n = twice_more(n)
        assert n == 2 * count

    return best(run, CALLS)


def signals():
    """Returns the signals in a second from another thread into an input, until the program has taken the last."""
    engine = esl.Engine()
    engine.eval("(progn (define-input scan :capacity 100000 :when-full :wait)"
                "(defun take (n) (dotimes (i n) (wait-for-event scan))))")
    scan = engine.inputs["scan"]
    count = 5 * CALLS

    def send():
        signal = scan.signal
        for number in range(count):
            signal(number)

    rates = []
    for _ in range(3):
        thread = threading.Thread(target=send)
        start = time.perf_counter()
        thread.start()
        engine.call("take", count)
        rates.append(count / (time.perf_counter() - start))
        thread.join()
    return max(rates)


def signals_of_asyncio():
    """Returns the same by `call_soon_threadsafe`."""
    count = CALLS

    async def main():
        loop = asyncio.get_running_loop()
        done, taken = asyncio.Event(), 0

        def take(number):
            nonlocal taken
            taken += 1
            if taken == count:
                done.set()

        def send():
            for number in range(count):
                loop.call_soon_threadsafe(take, number)

        thread = threading.Thread(target=send)
        start = time.perf_counter()
        thread.start()
        await done.wait()
        rate = count / (time.perf_counter() - start)
        thread.join()
        return rate

    return max(asyncio.run(main()) for _ in range(3))


def operations():
    """Returns the time of an operation that a task of asyncio begins and completes, one after another."""
    engine = esl.Engine()

    @engine.operation
    async def advance(n):
        return n + 1

    engine.eval("(defun steps (count) (let ((n 0)) (dotimes (i count n) (setq n (advance n)))))")

    async def main():
        async with engine.running():
            start = time.perf_counter_ns()
            assert await engine.call("steps", CALLS) == CALLS
            return (time.perf_counter_ns() - start) / CALLS

    return min(asyncio.run(main()) for _ in range(3))


def tasks_of_asyncio():
    async def advance(n):
        return n + 1

    async def main():
        start = time.perf_counter_ns()
        n = 0
        for _ in range(CALLS):
            n = await asyncio.create_task(advance(n))
        assert n == CALLS
        return (time.perf_counter_ns() - start) / CALLS

    return min(asyncio.run(main()) for _ in range(3))


def engines():
    def make(count):
        for _ in range(count):
            esl.Engine()

    return best(make, 50)


def states_of_lupa():
    import lupa.lua54 as lupa

    def make(count):
        for _ in range(count):
            lupa.LuaRuntime()

    return best(make, 50)


def scans():
    """Returns the time of a scan of 1,080 floats on its way to a program and back."""
    import numpy

    engine, scan = esl.Engine(), numpy.linspace(0.0, 5.0, 1080)

    def run(count):
        for _ in range(count):
            engine.call("identity", scan)

    return best(run, CALLS // 4)


ROWS = [
    calls, calls_of_lupa, signals, signals_of_asyncio, operations, tasks_of_asyncio, engines, states_of_lupa, scans,
]

if __name__ == "__main__":
    wanted = sys.argv[2:]
    print(json.dumps({row.__name__: row() for row in ROWS if not wanted or row.__name__ in wanted}))
