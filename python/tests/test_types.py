"""Annotations: checkers of types find nothing to complain of, in the package and in a program that uses it."""

import inspect
import os
import pathlib
import subprocess
import sys

import pytest

import esl
from esl import _esl

PACKAGE = pathlib.Path(esl.__file__).parent
SOURCES = [str(PACKAGE), str(pathlib.Path(__file__).parent / "typed_program.py")]


def checked(*command):
    # Output of a checker that is installed, and its status.
    pytest.importorskip(command[0])
    environment = {**os.environ, "PYRIGHT_PYTHON_IGNORE_WARNINGS": "1"}
    run = subprocess.run(
        [sys.executable, "-m", *command], capture_output=True, text=True, cwd=PACKAGE.parent, env=environment
    )
    return run.returncode, run.stdout + run.stderr


def test_mypy_finds_nothing():
    # What it has found out about other packages is kept beside this one.
    cache = str(PACKAGE.parent.parent / "python-mypy-cache")
    status, text = checked("mypy", "--strict", "--cache-dir", cache, *SOURCES)
    assert status == 0, text


def test_pyright_finds_nothing():
    status, text = checked("pyright", "--pythonpath", sys.executable, *SOURCES)
    assert status == 0, text


def test_the_package_says_that_it_has_annotations():
    assert (PACKAGE / "py.typed").is_file()


def test_the_stub_has_the_names_of_the_module():
    stub = (PACKAGE / "_esl.pyi").read_text()
    for name, value in vars(_esl).items():
        if name.startswith("__") or inspect.ismodule(value):
            continue
        if inspect.isclass(value):
            assert f"class {name}:" in stub, name
            for member in vars(value):
                if not member.startswith("__"):
                    assert f"def {member}(" in stub, f"{name}.{member}"
        else:
            assert f"def {name}(" in stub, name


def test_help_says_what_everything_is():
    untold = []
    for name in esl.__all__:
        value = getattr(esl, name)
        if not inspect.getdoc(value):
            untold.append(name)
        if not inspect.isclass(value):
            continue
        for member, function in vars(value).items():
            is_public = not member.startswith("_") and (callable(function) or isinstance(function, property))
            if is_public and not inspect.getdoc(function):
                untold.append(f"{name}.{member}")
    assert untold == []
