"""Values survive the way to a program and back, or are refused with a text that says what to do."""

import array
import math
import pickle

import pytest

import esl
from esl import Keyword, Symbol


@pytest.fixture(scope="module")
def engine():
    return esl.Engine()


def there_and_back(engine, value):
    return engine.call("identity", value)


def test_symbols_are_those_of_the_program(engine):
    engine.eval('(defpackage "FLEET" (:use "COMMON-LISP")) (defun is-it (a b) (eq a b))')
    for text in ["valve", "car", "assert", "|Valve|", "fleet::drive", "fleet::|Drive|", ":on", ":|On|", "esl:retract"]:
        symbol = engine.eval(f"'{text}")
        assert there_and_back(engine, symbol) == symbol
        engine.eval(f"(defun is-that (symbol) (eq symbol '{text}))")
        assert engine.call("is-that", symbol) is True, text
        assert pickle.loads(pickle.dumps(symbol)) == symbol
        assert eval(repr(symbol)) == symbol
    assert str(Symbol("fleet::drive")) == "FLEET::DRIVE"
    assert Symbol.exact("Valve") != Symbol("valve")
    assert engine.eval("'(|a| :|b| c)") == [Symbol.exact("a"), Keyword.exact("b"), Symbol("c")]
    # A package that does not exist has no symbol to be mixed up with another one.
    assert engine.call("is-it", Symbol("nowhere::valve"), Symbol("valve")) is None


def test_queries_know_the_words_of_the_language(engine):
    engine.facts.assert_("(age ann 40)")
    engine.facts.assert_("(age bob 3)")
    engine.facts.assert_("(likes ann bob)")
    assert engine.facts.query("(and (age ?who ?) (not (likes ?who ?)))") == [{"who": Symbol("bob")}]
    both = [Symbol("or"), [Symbol("likes"), Symbol("?who"), Symbol("?")], [Symbol("age"), Symbol("?who"), 3]]
    assert [row["who"] for row in engine.facts.query(both)] == [Symbol("ann"), Symbol("bob")]


def test_tables_are_dictionaries(engine):
    table = engine.eval(
        "(let ((table (make-hash-table :test 'equal))) (setf (gethash \"a\" table) 1 (gethash :on table) nil) table)"
    )
    assert table == {"a": 1, esl.Keyword("on"): None} and isinstance(table, esl.Table)
    table["b"] = esl.Table({(1, 2): [esl.Table()]})
    assert there_and_back(engine, table) == table
    engine.eval("(defun look (key table) (multiple-value-list (gethash key table)))")
    assert engine.call("look", "a", table) == [1, True]
    assert engine.call("look", "c", table) == [None, None]
    assert engine.call("hash-table-count", esl.Table({1: 2, 3: 4})) == 2
    for key, text in [("(list 1)", "cannot hash"), ("(copy-seq \"a\")", "two keys")]:
        with pytest.raises(ValueError, match=text):
            engine.eval(f"(let ((table (make-hash-table))) (dotimes (i 2) (setf (gethash {key} table) i)) table)")
    with pytest.raises(esl.Error):
        engine.eval("(let ((table (make-hash-table))) (setf (gethash 1 table) table) table)")


def test_objects_of_a_program_do_not_return(engine):
    for text, kind in [
        ("(make-hash-table :test 'equalp)", "HASHTABLE"),
        ("(spawn (sleep 0))", "TASK"),
        ("#'car", "CAR"),
    ]:
        made = engine.eval(text)
        assert isinstance(made, esl.ProgramObject)
        assert kind.lower() in str(made).lower(), str(made)
        assert "ESL program" in repr(made)
        with pytest.raises(TypeError, match="a variable of the program"):
            there_and_back(engine, made)
    engine.eval("(defstruct rover fuel)")
    nested = engine.eval("(list 1 (make-rover :fuel 3))")
    assert nested[0] == 1 and isinstance(nested[1], esl.ProgramObject)
    assert "rover" in str(nested[1]).lower()


def test_numbers_of_every_kind(engine):
    for value in [2**63, -(2**63), 2**63 - 1, 10**400, math.inf, -math.inf, -0.0, 5e-324]:
        back = there_and_back(engine, value)
        assert (back, type(back), repr(back)) == (value, type(value), repr(value))
    assert math.isnan(there_and_back(engine, math.nan))


def test_texts(engine):
    for value in ["", "é ∀ 🤖", 'a "b" \\', "\0", "line\nline"]:
        assert there_and_back(engine, value) == value
    with pytest.raises(UnicodeEncodeError):
        there_and_back(engine, "\ud800")


def test_bytes_and_buffers(engine):
    assert there_and_back(engine, bytes(range(256))) == bytes(range(256))
    assert there_and_back(engine, bytearray(b"ab")) == b"ab"
    assert there_and_back(engine, memoryview(b"abcd")[::2]) == b"ac"
    assert there_and_back(engine, array.array("Q", [1, 2**64 - 1])) == (1, 2**64 - 1)
    assert there_and_back(engine, array.array("h", [-5, 7])) == (-5, 7)
    assert there_and_back(engine, array.array("d")) == (), "without elements there is no type"


def test_what_has_no_counterpart(engine):
    for value in [{1, 2}, object(), 1j, range(3), {"a": {3: 4}}, iter([])]:
        with pytest.raises(TypeError):
            there_and_back(engine, value)


def test_numpy(engine):
    numpy = pytest.importorskip("numpy")
    scan = numpy.linspace(0.0, 5.0, 1080)
    back = there_and_back(engine, scan)
    # Without a copy: an array has a buffer.
    assert (numpy.asarray(back) == scan).all() and numpy.asarray(back).dtype == numpy.float64
    assert numpy.shares_memory(numpy.asarray(back), numpy.asarray(back))
    for kind in ["float32", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"]:
        values = numpy.arange(5).astype(kind)
        assert list(there_and_back(engine, values)) == [0, 1, 2, 3, 4], kind
        scalar = there_and_back(engine, values[3])
        assert scalar == 3 and type(scalar) in (int, float), kind
    assert list(there_and_back(engine, scan[::2])) == list(scan[::2]), "strides"
    assert there_and_back(engine, numpy.bool_(True)) is True
    assert there_and_back(engine, numpy.array([2**64 - 1], dtype="uint64")) == (2**64 - 1,)
    image = numpy.frombuffer(there_and_back(engine, numpy.zeros(12, dtype="uint8")), dtype="uint8")
    assert image.reshape(3, 4).shape == (3, 4)
    with pytest.raises(TypeError, match=r"2 dimensions.*ravel\(\)"):
        there_and_back(engine, numpy.zeros((2, 2)))
    for refused in [numpy.zeros(2, dtype="bool"), numpy.zeros(2, dtype="float16"), numpy.zeros(2, dtype=">f8")]:
        with pytest.raises(TypeError, match="astype"):
            there_and_back(engine, refused)
