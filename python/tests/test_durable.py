"""Durable runs: a process that is killed in the middle of an operation is followed by one that goes on there."""

import asyncio
import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import threading

import pytest

import esl

LIFE = """
    import os, signal, sys, esl

    dies_behind, dies_before = int(sys.argv[1]), int(sys.argv[2])
    engine = esl.DurableEngine("state", text='''
        (defvar *total* (count-to 5))
        (handler-case (shove) (failure (failure) (note (string (failure-cause failure)))))
        (exit *total*)''')

    def die():
        os.kill(os.getpid(), signal.SIGKILL)

    @engine.operation
    def count_to(goal):
        assert len(esl.action()) == 32
        done = int(esl.restore() or b"0")
        while done < goal:
            done += 1
            note(done)
            if done == dies_before:
                die()
            esl.save(str(done).encode())
            if done == dies_behind:
                die()
        return done

    @engine.operation
    def shove():
        note("shove")
        if dies_before == 9:
            die()

    @engine.function(idempotent=True)
    def note(line):
        with open("log", "a") as log:
            print(line, file=log)

    status = engine.run()
    # A process that dies while it repeats the journal is not counted.
    print(status, engine.resumed.process > 1)
"""


def test_a_killed_process_goes_on_in_the_middle_of_an_operation(tmp_path):
    def life(behind, before):
        command = [sys.executable, "-c", textwrap.dedent(LIFE), str(behind), str(before)]
        site = str(pathlib.Path(esl.__file__).parents[1])
        return subprocess.run(
            command,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": site},
            capture_output=True,
            text=True,
            timeout=60,
        )

    for behind, before in [(2, 0), (0, 3), (0, 9)]:
        killed = life(behind, before)
        assert killed.returncode == -signal.SIGKILL, killed.stderr
    ended = life(0, 0)
    assert ended.stdout == "5 True\n", ended.stderr
    # The state behind the third step was not saved, and nobody knows what became of the shove.
    log = (tmp_path / "log").read_text().split()
    assert log == ["1", "2", "3", "3", "4", "5", "shove", "INTERRUPTED-BY-RESTART"]
    assert life(0, 0).stderr != "", "a run that has ended has no process that goes on"


def test_another_process_and_another_program_are_refused(tmp_path):
    def made(text, **settings):
        return esl.DurableEngine(tmp_path / "state", text=text, **settings)

    first = made("(exit 3)").open()
    with pytest.raises(esl.NotDurable, match="in use"):
        made("(exit 3)").run()
    assert first.run() == 3 and first.resumed is None
    with pytest.raises(esl.NotDurable, match="another program"):
        made("(defun other () 1) (exit 4)").run()
    with pytest.raises(esl.CompileError) as refused:
        made("(exit").open()
    assert refused.value.diagnostics[0].code == "unclosed-list"
    with pytest.raises(esl.CompileError):
        esl.DurableEngine(tmp_path / "none", text="(exit").open()
    assert not (tmp_path / "none").exists()
    with pytest.raises(ValueError, match="`loss` is not a durability"):
        made("(exit 3)", durability="loss").open()
    with pytest.raises(ValueError, match="`never`"):
        made("(exit 3)", snapshot_every="soon").open()
    with pytest.raises(TypeError, match="name one of them"):
        esl.DurableEngine(tmp_path / "state")
    with pytest.raises(RuntimeError, match="no operation"):
        esl.save(b"x")


def test_a_paused_run_goes_on_with_async_operations(tmp_path):
    def made(seen):
        engine = esl.DurableEngine(
            tmp_path / "state", text="(exit (+ (twice 4) (progn (look) (sleep 0.001) (twice 5))))", output=seen.append
        )

        @engine.operation(idempotent=True)
        async def twice(number):
            await asyncio.sleep(0)
            esl.save(str(number).encode())
            seen.append(number)
            return 2 * number

        @engine.function
        def look():
            if len(seen) == 1:
                engine.pause()

        return engine

    seen = []
    assert asyncio.run(made(seen).run_async()) is None
    again = made(seen)
    assert asyncio.run(again.run_async()) == 18 and seen == [4, 5]
    assert again.resumed.process == 2 and again.resumed.downtime >= 0


def test_a_run_of_another_version_begins_anew_from_its_facts(tmp_path):
    def made(**settings):
        text = "(defdurable *count* 0) (incf *count*) (unless *begun-from-facts* (look) (sleep 0.001)) (exit *count*)"
        engine = esl.DurableEngine(tmp_path / "state", text=text, **settings)

        @engine.function
        def look():
            engine.pause()

        return engine

    assert made().run() is None
    journal = tmp_path / "state" / "journal.eslj"
    contents = bytearray(journal.read_bytes())
    contents[8:12] = (1).to_bytes(4, "little")
    journal.write_bytes(contents)
    with pytest.raises(esl.NotDurable, match="another version|cannot read"):
        made().open()
    again = made(from_facts=True)
    assert again.run() == 2
    with pytest.raises(RuntimeError, match="make another engine of its folder"):
        again.run()


def test_an_async_operation_under_way_goes_on_in_the_next_loop(tmp_path):
    def made():
        engine = esl.DurableEngine(tmp_path / "state", text="(exit (slow 3))")

        @engine.operation
        async def slow(number):
            if esl.restore() is None:
                esl.save(b"begun")
                engine.pause()
                await asyncio.sleep(3600)
            return number + len(esl.restore())

        return engine

    assert asyncio.run(made().run_async()) is None
    again = made()
    with pytest.raises(RuntimeError, match="`slow` is async, so the run needs an event loop"):
        again.run()
    assert asyncio.run(again.run_async()) == 8


def test_messages_of_other_threads_are_kept(tmp_path):
    def made():
        text = "(define-input order) (defvar *sum* 0) (loop (incf *sum* (wait-for-event order)) (tell *sum*))"
        engine = esl.DurableEngine(tmp_path / "state", text=text)
        told = threading.Semaphore(0)

        @engine.function(idempotent=True)
        def tell(sum_):
            sums.append(sum_)
            told.release()

        return engine, told

    sums = []
    for number in (1, 2):
        engine, told = made()
        handle = engine.handle()
        running = threading.Thread(target=engine.run)
        running.start()
        for order in (10, 20):
            while True:
                try:
                    handle.signal("order", order * number)
                    break
                except esl.NoSuchInput:
                    continue
            told.acquire()
        engine.pause()
        running.join()
    assert sums == [10, 30, 50, 90]
