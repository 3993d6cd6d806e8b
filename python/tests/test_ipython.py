"""ESL in IPython: the magics, completion, and a notebook that runs."""

import os
import pathlib

import pytest

pytest.importorskip("IPython")

NOTEBOOK = pathlib.Path(__file__).parents[2] / "docs" / "notebooks" / "rover.ipynb"


@pytest.fixture
def shell():
    from IPython.testing.globalipapp import start_ipython
    from IPython.core.interactiveshell import InteractiveShell

    InteractiveShell.clear_instance()
    made = start_ipython() or InteractiveShell.instance()
    made.run_line_magic("load_ext", "esl.ipython")
    made.user_ns.pop("engine", None)
    yield made
    made.user_ns.pop("engine", None)


def test_magics_share_an_engine_with_python(shell, capsys):
    import esl

    engine = shell.user_ns["engine"] = esl.Engine()

    @engine.function
    def read_sensor(number):
        return number / 2

    assert shell.run_cell_magic("esl", "", "(defun survey (n) (loop for s to n sum (read-sensor s)))\n(survey 4)") == 5.0
    assert shell.run_line_magic("esl", "(survey 2)") == 1.5
    assert shell.run_cell_magic("esl", "--out sum", "(survey 2)") is None
    assert shell.user_ns["sum"] == 1.5
    with pytest.raises(ValueError, match="--nothing"):
        shell.run_cell_magic("esl", "--nothing", "1")


def test_an_engine_is_made_if_there_is_none(shell, capsys):
    shell.run_cell_magic("esl", "", '(format t "hello~%")')
    assert capsys.readouterr().out == "hello\n"
    assert shell.user_ns["engine"].eval("1") == 1
    shell.user_ns["engine"] = 5
    with pytest.raises(TypeError, match="--engine NAME"):
        shell.run_cell_magic("esl", "", "1")


def test_completion(shell):
    shell.run_cell_magic("esl", "", "(defun survey-ridge () 1)")
    from IPython.core.completer import provisionalcompleter

    def completed(text):
        with provisionalcompleter():
            return [found.text for found in shell.Completer.completions(text, len(text))]

    for text in ["%esl (survey-r", "%%esl\n(list (survey-r"]:
        assert "survey-ridge" in completed(text), text
    assert "survey-ridge" not in completed("survey-r")


def test_a_failure_shows_its_report(shell):
    import esl

    with pytest.raises(esl.Failure, match="no recovery available") as raised:
        shell.run_cell_magic("esl", "", "(defun drive () (fail :stuck 3)) (drive)")
    assert raised.value.cause == ":STUCK" and raised.value.arguments == [3]


def test_the_notebook_runs():
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [os.getcwd(), os.environ.get("PYTHONPATH", "")]))
    nbclient.NotebookClient(notebook, timeout=60, kernel_name="python3").execute()
    kinds = {kind for cell in notebook.cells for output in cell.get("outputs", []) for kind in output.get("data", {})}
    assert "image/svg+xml" in kinds and "text/html" in kinds
    texts = [
        output.get("text", "") + str(output.get("data", {}).get("text/plain", ""))
        for cell in notebook.cells
        for output in cell.get("outputs", [])
    ]
    assert any("60" in text for text in texts)
