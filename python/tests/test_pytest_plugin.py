"""Tests in ESL as items of pytest."""

import os
import subprocess
import sys

import pytest

TESTS = """\
(defun roll () (random 4))
(deftest adding (is (= (+ 1 1) 2)))
(deftest waiting :seeds 3 (sleep 100) (is (> (now) 50)))
(deftest rolling :seeds 50 (is (< (roll) 3)))
(deftest racing :explore t
  (let ((count 0))
    (task-net (a (let ((c count)) (sleep 0) (setq count (+ c 1))))
              (b (let ((c count)) (sleep 0) (setq count (+ c 1)))))
    (is (= count 2))))
(deftest reading (is (with-open-file (s "/etc/passwd") (stringp (read-line s)))))
"""


def run_tests(folder, *options):
    command = [sys.executable, "-m", "pytest", "-p", "esl.pytest_plugin", "-p", "no:cacheprovider", "-v", *options]
    path = os.pathsep.join(filter(None, [os.getcwd(), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "200"}
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment, timeout=100)
    return run.returncode, run.stdout + run.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tests")
    (folder / "dice_test.esl").write_text(TESTS)
    (folder / "test_python.py").write_text("def test_python(): pass\n")
    (folder / "rover.esl").write_text("(this is no test")
    return folder


def test_tests_in_esl_are_items(folder):
    status, text = run_tests(folder)
    assert status == 1
    assert "dice_test.esl::adding PASSED" in text and "dice_test.esl::waiting PASSED" in text
    assert "test_python.py::test_python PASSED" in text
    assert "3 failed, 3 passed" in text
    assert "a check did not hold" in text and "run it again by --esl-seed" in text
    assert "dice_test.esl:4:" in text and "(< (ROLL) 3) is false." in text
    seed = text.split("run it again by --esl-seed ")[1].split()[0]
    status, text_again = run_tests(folder, "-k", "rolling", "--esl-seed", seed)
    assert status == 1 and f"--esl-seed {seed}" in text_again
    assert "under a schedule" in text and "PERMISSION-DENIED" in text.upper()


def test_options(folder):
    status, text = run_tests(folder, "--esl-allow", "read=/etc", "-k", "reading")
    assert status == 0 and "1 passed" in text, text
    status, text = run_tests(folder, "-k", "adding", "--esl-explore", "-rP")
    assert status == 0 and "all schedules" in text, text


def test_a_file_that_does_not_compile(tmp_path):
    (tmp_path / "broken_test.esl").write_text("(deftest adding (is")
    status, text = run_tests(tmp_path)
    assert status == 2 and "unclosed-list" in text and "Traceback" not in text
