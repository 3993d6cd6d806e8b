"""Bad use gets an exception with a text that says what to do: no crash, no leak, no hang."""

import gc
import multiprocessing
import os
import resource
import subprocess
import sys
import textwrap
import threading
import time
import weakref

import pytest

import esl


def run_program(text, timeout=60):
    # A program in a process of its own.
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(text)], capture_output=True, text=True, timeout=timeout
    )


def test_a_value_of_another_engine():
    one, other = esl.Engine(), esl.Engine()
    task = one.eval("(spawn (sleep 0))")
    with pytest.raises(TypeError, match="cannot be passed"):
        other.call("task-name", task)
    held = esl.Object({"a": 1})
    assert one.call("identity", held) is other.call("identity", held)


def test_settings_that_are_none():
    for settings, error, text in [
        ({"memory": -5}, ValueError, "-5 is not a size"),
        ({"memory": "64 MB"}, ValueError, "followed by K, M or G"),
        ({"allow": "net=127.0.0.1:1"}, TypeError, r"allow=\['net=127.0.0.1:1'\]"),
        ({"allow": ["network"]}, ValueError, "`network` is not a right"),
        ({"clock": "fake"}, ValueError, "`fake` is not a clock"),
    ]:
        with pytest.raises(error, match=text):
            esl.Engine(**settings)


def test_limits_have_their_names():
    with pytest.raises(esl.NoMemory, match=r"esl.Engine\(memory=…\)"):
        esl.Engine(memory=100)
    with pytest.raises(esl.BudgetSpent, match=r"esl.Engine\(budget=…\)"):
        esl.Engine(budget=100_000).eval("(loop)")


def test_a_file_that_cannot_be_read(tmp_path):
    engine = esl.Engine()
    with pytest.raises(FileNotFoundError) as raised:
        engine.load(tmp_path / "nothing.esl")
    assert str(raised.value) == f"[Errno 2] No such file or directory: '{tmp_path / 'nothing.esl'}'"
    with pytest.raises(IsADirectoryError):
        engine.load(tmp_path)
    (tmp_path / "latin.esl").write_bytes(b'(print "\xe9")')
    with pytest.raises(esl.Error, match="latin.esl.*utf-8"):
        esl.run(tmp_path / "latin.esl")


def test_a_lambda_is_no_function_of_a_program():
    engine = esl.Engine()
    for define in [engine.function, engine.operation]:
        with pytest.raises(TypeError, match="a lambda has no name"):
            define(lambda x: x)


def test_a_call_from_a_second_thread():
    engine = esl.Engine()
    engine.eval("(define-input done)")
    errors = []

    def call():
        try:
            engine.eval("1")
        except RuntimeError as error:
            errors.append(str(error))
        engine.inputs["done"].signal()

    done = engine.inputs["done"]
    thread = threading.Timer(0.05, call)
    thread.start()
    engine.eval("(wait-for-event done)")
    thread.join()
    assert len(errors) == 1 and "one thread at a time" in errors[0] and "handle" in errors[0]
    assert done.name == "done"


def test_engines_may_go_from_thread_to_thread():
    engine = esl.Engine()
    values = []
    for number in range(3):
        thread = threading.Thread(target=lambda n=number: values.append(engine.eval(f"(+ 1 {n})")))
        thread.start()
        thread.join()
    assert values == [1, 2, 3]


def test_callbacks_that_raise_anything():
    engine = esl.Engine()

    class Strange(BaseException):
        def __str__(self):
            raise RuntimeError("no text")

    @engine.function
    def raise_it(kind):
        raise {"strange": Strange(), "exit": SystemExit(5), "interrupt": KeyboardInterrupt()}[kind]

    for kind, expected in [("strange", Strange), ("exit", SystemExit), ("interrupt", KeyboardInterrupt)]:
        with pytest.raises(expected):
            engine.call("raise-it", kind)
        assert engine.eval(f'(handler-case (raise-it "{kind}") (failure (f) (first (failure-arguments f))))') == (
            expected.__name__
        )
    assert engine.eval("(+ 1 2)") == 3


def test_a_callback_that_returns_what_a_program_cannot_have():
    engine = esl.Engine()

    @engine.function
    def make():
        return {1, 2}

    @engine.operation
    def make_later():
        return {1, 2}

    for name in ["make", "make-later"]:
        with pytest.raises(TypeError, match="esl.Object"):
            engine.call(name)


def test_a_handle_after_the_end():
    engine = esl.Engine()
    engine.eval("(define-input scan)")
    handle, scan = engine.handle(), engine.inputs["scan"]
    reply = handle.call("list", 1)
    del engine
    gc.collect()
    for use in [lambda: handle.signal("scan"), lambda: scan.signal(1), lambda: handle.call("list").wait(), reply.wait]:
        with pytest.raises(esl.Ended):
            use()
    handle.pause()
    handle.stop()


def test_an_answer_is_taken_once():
    engine = esl.Engine()
    reply = engine.handle().call("list", 1)
    while not reply.take()[0]:
        engine._machine.poll(1000)
    with pytest.raises(esl.Ended):
        reply.take()
    with pytest.raises(esl.Ended):
        reply.wait()


def test_an_operation_ends_once():
    engine = esl.Engine()
    operations = []
    engine._machine.define_operation("WAIT", "()", "", operations.append)
    task = engine.handle().spawn("wait")
    engine._machine.poll(1000)
    (operation,) = operations
    operation.complete(1)
    for use in [operation.complete, lambda: operation.fail(ValueError()), lambda: operation.arguments]:
        with pytest.raises(RuntimeError, match="has ended"):
            use()
    operation.drop()
    operation.report_progress(1)
    operation.on_cancel(print)
    engine._machine.poll(1000)
    assert task.take() == (True, 1)


def test_an_operation_may_outlive_its_engine():
    engine = esl.Engine()
    operations = []
    engine._machine.define_operation("WAIT", "()", "", operations.append)
    engine.handle().spawn("wait")
    engine._machine.poll(1000)
    operations[0].on_cancel(lambda: operations[0].drop())
    del engine
    gc.collect()
    with pytest.raises(RuntimeError, match="has ended"):
        operations[0].complete(1)


def test_bad_names_and_parameters():
    engine = esl.Engine()
    with pytest.raises(TypeError, match=r"`\*rest`: name its arguments"):

        @engine.function
        def collect(*rest):
            return rest

    with pytest.raises(esl.CompileError, match="locked"):

        @engine.function
        def car(x):
            return x

    with pytest.raises(ValueError, match="`64Q` is not a size"):
        esl.Engine(memory="64Q")
    with pytest.raises(esl.NoMemory):
        esl.Engine(memory=1000)


def test_engines_are_freed_with_their_functions():
    class Rover:
        pass

    rover = Rover()
    engine = esl.Engine()

    @engine.function
    def report():
        return rover is None

    @engine.operation
    async def drive():
        return rover

    watched = weakref.ref(rover), weakref.ref(engine)
    engine.facts.watch("(at ?)", lambda change: rover)
    del rover, engine, report, drive
    gc.collect()
    assert [reference() for reference in watched] == [None, None]


def test_engines_in_a_cycle_are_collected_with_their_cleanups():
    ended = []

    def make():
        engine = esl.Engine()

        @engine.function
        def motors_off():
            # The machine holds this function, and this function the engine.
            ended.append(engine is not None)

        @engine.operation
        async def drive():
            return engine

        engine.observe(lambda event: engine, kinds=["fails"])
        engine.eval("(spawn (unwind-protect (sleep 1000) (motors-off)))")
        engine.eval("(sleep 0)")
        return weakref.ref(engine)

    reference = make()
    gc.collect()
    assert reference() is None
    assert ended == [True]


def memory():
    # Bytes of memory that this process uses.
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


def test_engines_made_and_dropped_leave_nothing():
    def make(count):
        for _ in range(count):
            engine = esl.Engine()
            assert engine.inputs is not None

    # ESL_ENGINES=100000 makes as many. They are freed at once, not by the collector.
    gc.collect()
    count = int(os.environ.get("ESL_ENGINES", "100"))
    make(50)
    before = memory()
    make(count)
    assert memory() - before < 4 << 20, f"{memory() - before} bytes of {count} engines"


def test_calls_leave_nothing():
    engine = esl.Engine()

    @engine.function
    def echo(value):
        return value

    def call(count):
        for _ in range(count):
            engine.call("echo", [1, "a", b"abc", 1.5, esl.Keyword("on")])
            with pytest.raises(KeyError):
                engine.call("look-up")

    @engine.function
    def look_up():
        return {}["key"]

    def collect():
        # The program holds an exception until its own collector has run.
        engine.eval("(dotimes (i 100000) (make-array 100))")
        gc.collect()

    call(300)
    collect()
    before = len(gc.get_objects()), memory()
    call(1500)
    collect()
    assert len(gc.get_objects()) - before[0] < 50
    assert memory() - before[1] < 8 << 20


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the system has no fork")
def test_fork_after_make():
    run = run_program(
        """
        import os, sys, warnings
        warnings.simplefilter("ignore")
        import esl
        engine = esl.Engine()

        @engine.function
        def motors_off():
            print("motors off in", "child" if os.getpid() != parent else "parent", flush=True)

        parent = os.getpid()
        handle = engine.handle()
        engine.eval("(spawn (unwind-protect (sleep 1000) (motors-off)))")
        engine.eval("(sleep 0)")
        child = os.fork()
        if child == 0:
            for use in [lambda: engine.eval("1"), lambda: handle.signal("scan"), engine.handle]:
                try:
                    use()
                except RuntimeError as error:
                    assert "forked" in str(error) and "spawn" in str(error), error
                else:
                    os._exit(3)
            # An engine of its own works.
            assert esl.Engine().eval("(+ 1 2)") == 3
            del engine, handle
            sys.exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert engine.eval("(+ 1 2)") == 3
        """
    )
    assert (run.returncode, run.stdout) == (0, "motors off in parent\n"), run.stderr


def work(number):
    return esl.Engine().eval(f"(* 2 {number})")


def test_processes_of_a_pool():
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(work, [1, 2]) == [2, 4]


def test_exit_while_a_call_is_open():
    run = run_program(
        """
        import threading, time
        import esl
        engine = esl.Engine()

        @engine.function
        def look():
            time.sleep(0.001)

        thread = threading.Thread(target=lambda: engine.eval("(loop (look))"), daemon=True)
        thread.start()
        time.sleep(0.1)
        print("leaves", flush=True)
        """
    )
    assert (run.returncode, run.stdout) == (0, "leaves\n"), run.stderr


def test_exit_runs_cleanups():
    run = run_program(
        """
        import esl
        engine = esl.Engine()

        @engine.function
        def motors_off():
            print("motors off", flush=True)

        @engine.operation
        def wait():
            import time
            time.sleep(1000)

        engine.eval("(spawn (unwind-protect (sleep 1000) (motors-off)))")
        engine.eval("(sleep 0)")
        """
    )
    assert (run.returncode, run.stdout) == (0, "motors off\n"), run.stderr


def test_exit_within_a_callback():
    run = run_program(
        """
        import sys
        import esl
        engine = esl.Engine()

        @engine.function
        def leave():
            sys.exit(7)

        engine.eval("(leave)")
        """
    )
    assert run.returncode == 7, run.stderr


def test_an_interrupt_in_a_loop_of_asyncio_runs_the_cleanups():
    run = run_program(
        """
        import asyncio, os, signal, threading
        import esl
        signal.signal(signal.SIGINT, signal.default_int_handler)
        engine = esl.Engine()

        @engine.function
        def motors_off():
            print("motors off", flush=True)

        async def main():
            async with engine.running():
                await engine.eval("(unwind-protect (loop (sleep 0.001)) (motors-off))")

        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            asyncio.run(main())
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        """
    )
    assert run.returncode == 0 and sorted(run.stdout.split("\n")) == ["", "interrupted", "motors off"], run.stderr


def test_threads_of_operations_are_used_again():
    engine = esl.Engine()
    names = set()

    @engine.operation
    def echo(number):
        names.add(threading.current_thread().name + str(threading.get_ident()))
        return number

    for number in range(20):
        assert engine.call("echo", number) == number
        time.sleep(0.001)
    assert len(names) < 10
