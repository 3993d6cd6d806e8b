"""What the package promises: evaluation, values, functions, failures, facts, inputs, threads."""

import array
import os
import pickle
import signal
import threading
import time
from fractions import Fraction

import pytest

import esl
from esl import Character, Dotted, Keyword, Object, Symbol, Table


@pytest.fixture
def engine():
    engine = esl.Engine()
    yield engine
    engine.end()


VALUES = [
    (None, "NIL"),
    (True, "T"),
    (42, "42"),
    (-(2**80), "-1208925819614629174706176"),
    (Fraction(2, 3), "2/3"),
    (1.5, "1.5"),
    ("ridge", '"ridge"'),
    (Character("x"), "#\\x"),
    (Keyword("on"), ":ON"),
    (Symbol("valve"), "VALVE"),
    ([1, [2], "a"], '(1 (2) "a")'),
    (Dotted([1, 2], 3), "(1 2 . 3)"),
    ((1, ("a", 2)), '#(1 #("a" 2))'),
    (b"\x00\xff", "#(0 255)"),
    (array.array("d", [0.5, -1.0]), "#(0.5 -1.0)"),
]


@pytest.mark.parametrize("value, printed", VALUES, ids=[printed for _, printed in VALUES])
def test_values_survive_the_way_to_a_program_and_back(engine, value, printed):
    assert engine.call("identity", value) == value
    assert type(engine.call("identity", value)) is type(value)
    assert engine.call("prin1-to-string", value) == printed


def test_values_without_a_way_back(engine):
    assert engine.call("prin1-to-string", {"max_speed": 0.5, "name": "a"}) == '(:MAX-SPEED 0.5 :NAME "a")'
    assert engine.call("identity", False) is None
    assert engine.call("identity", array.array("f", [0.5])) == array.array("d", [0.5])
    assert engine.call("identity", (0.5, 1.5)) == array.array("d", [0.5, 1.5])
    assert engine.call("identity", array.array("q", [1, 2**40])) == (1, 2**40)
    held = {1: 2}
    assert engine.call("identity", Object(held)) is held
    with pytest.raises(TypeError, match="esl.Object"):
        engine.call("identity", object())
    with pytest.raises(TypeError, match="key of a dictionary"):
        engine.call("identity", {1: 2})
    deep = []
    for _ in range(5000):
        deep = [deep]
    with pytest.raises(ValueError, match="1000 levels"):
        engine.call("identity", deep)


def test_functions_have_the_parameters_of_python(engine):
    @engine.function
    def drive_to(place: str, hurry: bool = False, *, max_speed: float = 0.5):
        """Drives to a place."""
        return [place, hurry, max_speed]

    assert engine.eval('(drive-to "ridge")') == ["ridge", None, 0.5], "False is NIL, which is None"
    assert engine.eval('(drive-to "ridge" t :max-speed 2)') == ["ridge", True, 2]
    assert engine.eval("(documentation 'drive-to 'function)") == "Drives to a place."
    with pytest.raises(esl.Failure, match="argument"):
        engine.eval("(drive-to)")


def test_exceptions_are_failures_and_come_back_as_themselves(engine):
    @engine.function
    def stick(number):
        raise esl.Failure("valve-stuck", [number, "left"])

    @engine.function
    def look_up(key):
        return {}[key]

    recovered = engine.eval(
        "(with-recovery-procedures (((:valve-stuck number side) (values (list number side)))) (stick 3))"
    )
    assert recovered == [3, "left"]
    with pytest.raises(esl.Failure) as raised:
        engine.eval("(stick 3)")
    assert (raised.value.cause, raised.value.arguments) == (":VALVE-STUCK", [3, "left"])
    assert raised.value.frames and raised.value.report
    assert pickle.loads(pickle.dumps(raised.value)).cause == ":VALVE-STUCK"
    assert engine.eval('(handler-case (look-up "a") (failure (f) (failure-cause f)))') == Keyword("python-error")
    with pytest.raises(KeyError, match="a"):
        engine.eval('(look-up "a")')


def test_failures_have_places(engine, tmp_path):
    file = tmp_path / "valve.esl"
    file.write_text("(defun open-valve (n)\n  (fail :stuck n))\n\n(defun survey () (list (open-valve 3)))\n")
    engine.load(file)
    with pytest.raises(esl.Failure) as raised:
        engine.call("survey")
    frame = next(frame for frame in raised.value.frames if not frame.is_of_library)
    assert (frame.function, frame.place.line) == ("OPEN-VALVE", 2)
    assert frame.place.source.endswith("valve.esl")
    with pytest.raises(esl.CompileError, match="unclosed-list"):
        engine.eval("(list 1")
    with pytest.raises(FileNotFoundError):
        engine.load(tmp_path / "nothing.esl")


def test_limits_and_rights():
    with pytest.raises(esl.BudgetSpent):
        esl.Engine(budget=1_000_000).eval("(loop)")
    with pytest.raises(esl.Failure) as raised:
        esl.Engine(memory="16M").eval("(let ((all nil)) (loop (push (make-array 10000) all)))")
    assert raised.value.cause == ":HEAP-EXHAUSTED"
    with pytest.raises(esl.Failure) as raised:
        esl.Engine().eval('(with-open-file (s "/etc/passwd") (read-line s))')
    assert raised.value.cause == ":PERMISSION-DENIED"
    assert esl.Engine(allow=["read=/etc"]).eval('(with-open-file (s "/etc/passwd") (stringp (read-line s)))') is True
    assert esl.Engine(clock="virtual").eval("(progn (sleep 3600) (now))") == 3600.0
    with pytest.raises(ValueError, match="`fly` is not a right"):
        esl.Engine(allow=["fly=high"])
    with pytest.raises(ValueError, match="`lunar` is not a clock"):
        esl.Engine(clock="lunar")


def test_facts(engine):
    assert engine.facts.assert_("(at rover ridge)") is True
    assert engine.facts.assert_([Symbol("at"), Symbol("probe"), (1, 2)]) is True
    assert engine.facts.query("(at ?robot ?place)") == [
        {"robot": Symbol("rover"), "place": Symbol("ridge")},
        {"robot": Symbol("probe"), "place": (1, 2)},
    ]
    assert engine.facts.retract("(at rover ?)") == 1
    assert engine.facts.query("(at rover ?place)") == []


def test_signals_from_other_threads(engine):
    engine.eval("(define-input scan :capacity 100)")
    scan = engine.inputs["scan"]

    def sense():
        for number in range(100):
            scan.signal(array.array("f", [number, 0.5]))

    sensor = threading.Thread(target=sense)
    sensor.start()
    assert engine.eval("(loop repeat 100 sum (elt (wait-for-event scan) 0))") == 4950.0
    sensor.join()
    with pytest.raises(esl.NoSuchInput):
        engine.inputs["no-such-input"].signal()


def test_operations_on_threads(engine):
    @engine.operation
    def drive(metres, *, speed=1.0):
        time.sleep(0.01)
        if metres > 10:
            raise esl.Failure("obstacle", [7])
        return metres / speed

    assert engine.eval("(multiple-value-list (task-net (a (drive 3)) (b (drive 4 :speed 2))))") == [3.0, 2.0]
    assert engine.eval("(handler-case (drive 50) (failure (f) (failure-arguments f)))") == [7]


def test_a_call_within_a_call_is_refused(engine):
    @engine.function
    def again():
        return engine.eval("1")

    with pytest.raises(RuntimeError, match="use a handle"):
        engine.eval("(again)")
    assert engine.eval("(+ 1 2)") == 3


def test_an_interrupt_runs_the_cleanups(engine):
    ended = []

    @engine.function
    def motors_off():
        ended.append(True)

    # A shell has its background jobs ignore the signal, and Python leaves it so.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            engine.eval("(unwind-protect (loop) (motors-off))")
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [True]


def test_many_engines():
    for _ in range(50):
        assert esl.Engine().eval("(+ 1 2)") == 3
