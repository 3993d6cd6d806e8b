"""Watching and changing a run: output, events, facts, patches, definitions, diagnostics, recordings."""

import asyncio
import gc
import io
import textwrap
import time
import weakref

import pytest

import esl
from esl import Symbol
from esl._progress import StatusLine


@pytest.fixture
def engine():
    engine = esl.Engine()
    yield engine
    engine.end()


def test_output_goes_to_a_function(capfd):
    texts = []
    engine = esl.Engine(output=texts.append)
    engine.eval('(progn (format t "rover é~%") (format *error-output* "late~%") (write-char #\\🤖))')
    assert "".join(texts) == "rover é\nlate\n🤖"
    assert capfd.readouterr() == ("", "")


def test_output_that_is_refused_does_not_end_the_program(monkeypatch):
    unraised = []
    monkeypatch.setattr("sys.unraisablehook", lambda raised: unraised.append(raised.exc_value))

    def refuse(_):
        raise ValueError("full")

    engine = esl.Engine(output=refuse)
    assert engine.eval("(progn (print 1) 2)") == 2
    assert [str(error) for error in unraised] == ["full"]


def test_events_of_tasks(engine):
    events = []
    with engine.observe(events.append):
        engine.eval("(ignore-errors (wait-for-task (spawn (:name 'probe) (fail :lost))))")
    probe = next(event.task for event in events if event.kind == "begins" and "PROBE" in event.detail)
    course = [(event.kind, event.detail) for event in events if event.task == probe]
    assert course[0][0] == "begins" and course[-1] == ("ends", "failed")
    assert ("fails", ":LOST") in course and ("runs", None) in course
    assert [event.time for event in events] == sorted(event.time for event in events)
    count = len(events)
    engine.eval("(wait-for-task (spawn 1))")
    assert len(events) == count, "the observation was stopped"


def test_events_of_some_kinds(engine):
    events = []
    engine.observe(events.append, kinds=["asserts", "retracts"])
    engine.eval("(progn (assert '(at rover ridge)) (retract '(at rover ?)))")
    assert [(event.kind, event.detail) for event in events] == [
        ("asserts", "(AT ROVER RIDGE)"),
        ("retracts", "(AT ROVER RIDGE)"),
    ]


def test_an_observer_that_raises_changes_nothing(engine, monkeypatch):
    unraised = []
    monkeypatch.setattr("sys.unraisablehook", lambda raised: unraised.append(raised.exc_type))

    def refuse(_):
        raise ValueError

    engine.observe(refuse, kinds=["fails"])
    assert engine.eval("(handler-case (fail :lost) (failure (f) 5))") == 5
    assert engine.eval("(+ 1 2)") == 3
    assert unraised == [ValueError]


def test_watched_facts(engine):
    changes = []
    watch = engine.facts.watch("(at ?robot (?x . ?rest))", changes.append)
    engine.eval(
        """(progn (assert '(at rover (1 2 3))) (assert '(at probe base)) (assert '(at probe (4)))
                  (assert '(battery 1)) (retract '(at rover ?)) (sleep 0.01))"""
    )
    assert [(change.is_there, change.bindings) for change in changes] == [
        (True, {"robot": Symbol("rover"), "x": 1, "rest": [2, 3]}),
        (True, {"robot": Symbol("probe"), "x": 4, "rest": None}),
        (False, {"robot": Symbol("rover"), "x": 1, "rest": [2, 3]}),
    ]
    assert changes[1].fact == [Symbol("at"), Symbol("probe"), [4]]
    watch.stop()
    engine.eval("(progn (sleep 0.01) (assert '(at rover (5))) (sleep 0.01))")
    assert len(changes) == 3


def test_a_variable_twice_is_one_value(engine):
    changes = []
    with engine.facts.watch("(same ?x ?x ?)", changes.append):
        engine.eval("(progn (assert '(same 1 2 3)) (assert '(same (4) (4) 5)) (sleep 0.01))")
    assert [change.bindings for change in changes] == [{"x": [4]}]


def test_changes_of_facts_in_a_loop(engine):
    async def main():
        async with engine.running():
            seen = []
            await engine.eval("(spawn (loop for x from 1 to 3 do (sleep 0.01) (assert (list 'at x))))")
            async for change in engine.facts.changes("(at ?x)"):
                seen.append(change.bindings["x"])
                if len(seen) == 3:
                    return seen

    assert asyncio.run(asyncio.wait_for(main(), 20)) == [1, 2, 3]


def test_definitions(engine):
    @engine.function
    def read_sensor(number, scale=0.5, *, unit="C", exact=False):
        """The temperature."""

    @engine.operation
    def drive(metres):
        """Drives."""

    engine.eval(
        """(define-input scan :capacity 3) (define-property battery (robot)) (defvar *speed* 1 "Metres per second.")
           (defconstant +wheels+ 4) (defmacro twice (form) "Does it twice." `(progn ,form ,form))"""
    )
    rows = {row.name: row for row in engine.definitions()}
    assert rows["READ-SENSOR"] == (
        "function", "READ-SENSOR", 'number &optional (scale 0.5) &key (unit "C") (exact :%not-given)', "The temperature.",
    )
    assert {name: row.kind for name, row in rows.items()} == {
        "READ-SENSOR": "function", "DRIVE": "operation", "SCAN": "input", "BATTERY": "property", "*SPEED*": "variable",
        "+WHEELS+": "constant", "TWICE": "macro",
    }
    assert rows["BATTERY"].parameters == "robot" and rows["*SPEED*"].documentation == "Metres per second."
    assert list(engine.inputs) == ["scan"] and "SCAN" in engine.inputs and len(engine.inputs) == 1
    with pytest.raises(esl.Failure, match="(?i)no-such"):
        engine.definitions("no-such")


def test_patches(engine):
    engine.eval("(defun pace () 1)")
    assert engine.patch("(defun pace () 2) (defun fresh () 3)") == 2
    assert engine.eval("(list (pace) (fresh))") == [2, 3]
    with pytest.raises(esl.Error):
        engine.patch("(defun pace () 5) (defun broken (")
    with pytest.raises(esl.Failure, match="(?i)patch consists of"):
        engine.patch("(print 1)")
    assert engine.call("pace") == 2, "none of it was applied"
    assert engine.undo_patch() == 2
    assert engine.call("pace") == 1
    assert engine.undo_patch() is None


def test_diagnostics_are_data(engine, tmp_path):
    with pytest.raises(esl.CompileError) as raised:
        engine.eval('(list "é")\n  (let 5)')
    (found,) = raised.value.diagnostics
    assert (found.severity, found.code, found.place) == ("error", "malformed-binding", ("<text>", 2, 8))
    assert found.end.column > found.place.column and found.message in str(found)
    file = tmp_path / "rover.esl"
    file.write_text("(defun drive (x)\n  (survey x))\n(print (undefined-door))\n")
    findings = esl.check_file(file)
    assert {(found.severity, found.place.line) for found in findings} == {("warning", 2), ("warning", 3)}
    assert all(found.place.source == str(file) for found in findings)
    file.write_text("(list 1")
    with pytest.raises(esl.CompileError) as raised:
        engine.load(file)
    assert raised.value.diagnostics[0].code == "unclosed-list"
    assert raised.value.diagnostics[0].place == (str(file), 1, 1)
    assert esl.check("(+ 1 2)") == []


def test_a_program_that_exits():
    ended = []
    engine = esl.Engine()

    @engine.function
    def motors_off():
        ended.append(True)

    for text in ["(unwind-protect (exit 3) (motors-off))", "(progn (spawn (exit 3)) (sleep 5))"]:
        with pytest.raises(esl.Exited, match="status 3") as raised:
            engine.eval(text)
        assert raised.value.status == 3
        assert engine.eval("(+ 1 2)") == 3, "another run begins"
    assert ended == [True]
    engine.eval("(defun leave () (exit 0))")
    with pytest.raises(esl.Exited):
        engine.call("leave")

    async def main():
        async with engine.running():
            with pytest.raises(esl.Exited) as raised:
                await engine.call("leave")
            assert raised.value.status == 0
            assert await engine.eval("(+ 1 2)") == 3
            with pytest.raises(esl.Aborted):
                await engine.eval("(abort-task (current-task))")

    asyncio.run(asyncio.wait_for(main(), 20))


def test_recordings(tmp_path):
    program = tmp_path / "dice.esl"
    program.write_text("(dotimes (i 3) (sleep 0.01) (format t \"~a \" (random 1000)))\n(exit 4)\n")
    recording, texts = tmp_path / "dice.eslj", []
    assert esl.run(program, recording=recording, output=texts.append) == (4, None)
    again = esl.replay(recording)
    assert (again.status, again.difference, again.output) == (4, None, "".join(texts))
    failing = tmp_path / "failing.esl"
    failing.write_text("(defun drive () (fail :stuck))\n(list (drive))\n")
    status, report = esl.run(failing, output=texts.append, clock="virtual")
    assert status == 1 and "failing.esl:1" in report
    with pytest.raises(RuntimeError):
        esl.replay(program)
    with pytest.raises(FileNotFoundError):
        esl.run(tmp_path / "nothing.esl")


def recorded_roll(replay=None):
    texts = []
    engine = esl.Engine(output=texts.append, record=replay is None, replay=replay)

    @engine.function
    def roll():
        assert replay is None, "a replay does not call it"
        return 4

    @engine.operation
    def drive(metres):
        assert replay is None, "a replay does not begin it"
        return 2 * metres

    return engine, texts


MISSION = "(progn (print (list (roll) (drive 3) (random 1000) (now))) (sleep 0.01) (get-universal-time))"


def test_a_recording_of_an_engine_is_replayed():
    engine, texts = recorded_roll()
    time = engine.eval(MISSION)
    recording = engine.recording()
    assert len(recording) > 5 and "records" in repr(recording)
    replay, texts_again = recorded_roll(recording)
    assert replay.eval(MISSION) == time
    assert texts_again == texts and replay.canary == engine.canary


def test_a_recording_in_a_loop_is_replayed():
    async def main(replay=None):
        engine = esl.Engine(record=replay is None, replay=replay)

        @engine.operation
        async def drive(metres):
            await asyncio.sleep(0.003)
            return metres

        async with engine.running():
            spot = await engine.eval("(progn (sleep 0.002) (list (drive 3) (now)))")
        return engine, spot

    engine, spot = asyncio.run(asyncio.wait_for(main(), 20))
    replay, again = asyncio.run(asyncio.wait_for(main(engine.recording()), 20))
    assert again == spot and replay.canary == engine.canary


def test_a_replay_with_other_calls_is_refused():
    engine, _ = recorded_roll()
    engine.eval(MISSION)
    engine.call("identity", 1)
    recording = engine.recording()
    for other in [
        lambda replay: replay.eval("(drive 5)"),
        lambda replay: (replay.eval(MISSION), replay.call("identity", 2)),
    ]:
        replay, _ = recorded_roll(recording)
        with pytest.raises(esl.Diverged, match="the replay has diverged at record"):
            other(replay)
    replay, _ = recorded_roll(recording)
    replay.eval(MISSION)
    assert replay.call("identity", 1) == 1
    with pytest.raises(esl.Diverged, match="no such evaluation"):
        replay.eval("(sleep 1000)")
    with pytest.raises(RuntimeError, match="record=True"):
        replay.recording()
    with pytest.raises(ValueError, match="not both"):
        esl.Engine(record=True, replay=recording)


def test_what_has_watched_leaves_nothing(engine):
    class Function:
        def __call__(self, *_):
            pass

    for watches in [lambda f: engine.facts.watch("(at ?place)", f), lambda f: engine.observe(f)]:
        functions = []
        for _ in range(20):
            function = Function()
            functions.append(weakref.ref(function))
            with watches(function):
                engine.eval("(assert '(at ridge))")
        del function
        engine.eval("(retract '(at ridge))")
        gc.collect()
        assert [reference() for reference in functions] == [None] * 20


def test_tasks(engine):
    engine.eval("(spawn (:name 'probe) (spawn (:name 'camera) (sleep 100)) (sleep 100))")
    engine.eval("(sleep 0.001)")
    tasks = engine.tasks()
    names = [task.name for task in tasks]
    probe = next(task for task in tasks if "PROBE" in task.name)
    assert [task.name for task in tasks.children(probe.number)] == [name for name in names if "CAMERA" in name]
    lines = str(tasks).splitlines()
    assert lines[0].startswith(probe.name) and lines[1].startswith("  ") and "waits for" in lines[1]
    assert tasks._repr_html_().count("<tr>") == 3
    engine.handle().abort(probe.number)
    engine.eval("(sleep 0.001)")
    assert "PROBE" not in str(engine.tasks())


def test_timelines(engine):
    with engine.timeline() as timeline:
        engine.eval("(wait-for-task (spawn (:name 'probe) (sleep 0.001)))")
    engine.eval("(wait-for-task (spawn (:name 'later) 1))")
    assert timeline._repr_svg_().startswith("<svg")
    assert "PROBE" in timeline.svg and "LATER" not in timeline.svg


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_long_loads_are_shown(monkeypatch):
    monkeypatch.delenv("TERM", raising=False)
    screen = Terminal()
    with StatusLine("loading rover.esl", screen, patience=0.01):
        time.sleep(0.1)
    assert "loading rover.esl, 0 s" in screen.getvalue() and screen.getvalue().endswith("\r\x1b[K")
    screen = Terminal()
    with StatusLine("loading rover.esl", screen):
        pass
    assert screen.getvalue() == "", "a short load is not shown"


def test_a_load_in_a_loop_is_awaited(engine, tmp_path):
    file = tmp_path / "rover.esl"
    file.write_text(textwrap.dedent("(sleep 0.01)\n(defun pace () 7)\n(pace)\n"))

    async def main():
        async with engine.running():
            assert await engine.load(file) == 7

    asyncio.run(asyncio.wait_for(main(), 20))


def test_completions(engine):
    engine.eval('(defun survey-ridge () "Looks at the ridge." 1)')
    assert ("survey-ridge", "Looks at the ridge.") in engine.completions("surv")
    assert engine.completions('"') == []
