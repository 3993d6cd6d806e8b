"""Tests in ESL as items of pytest: each `deftest` of a file `*_test.esl` is one.

    pytest --esl-seed 7           one seed for all tests, in place of their own
    pytest --esl-explore          under all schedules of their tasks
    pytest --esl-allow read=/etc  rights of the tests
    pytest --esl-budget 1000000   ticks of each test
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Iterator, Optional

import pytest

from . import _esl
from .errors import CompileError, Error

ENDS = ("_test", "-test", "_tests", "-tests")


class TestFailed(Exception):
    """A test in ESL has failed: the reason, and its output."""

    # pytest takes classes of this name for tests.
    __test__ = False


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("esl", "tests in ESL")
    group.addoption("--esl-seed", type=int, default=None, help="the one seed of tests in ESL, in place of their own")
    group.addoption(
        "--esl-explore", action="store_true", help="run tests in ESL under all schedules of their tasks"
    )
    group.addoption(
        "--esl-allow", action="append", default=[], metavar="RIGHT", help="grant tests in ESL a right: read=/etc"
    )
    group.addoption("--esl-budget", type=int, default=None, help="ticks of each test in ESL")
    group.addoption(
        "--esl-path", action="append", default=[], metavar="FOLDER", help="find modules of ESL in this folder"
    )


def is_test_file(path: Path) -> bool:
    """Returns whether a file has the name of one with tests, as `eslvm test` has it."""
    return path.suffix == ".esl" and (path.stem in ("test", "tests") or path.stem.endswith(ENDS))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> Optional[pytest.Collector]:
    if is_test_file(file_path):
        return EslFile.from_parent(parent, path=file_path)
    return None


class EslFile(pytest.File):
    """A file with tests in ESL."""

    def collect(self) -> Iterator[pytest.Item]:
        def option(name: str) -> Any:
            return self.config.getoption(name)

        try:
            tests = _esl.Tests(
                self.path,
                [Path(folder) for folder in option("--esl-path")],
                option("--esl-allow"),
                option("--esl-budget"),
            )
        except CompileError as error:
            raise self.CollectError(str(error)) from None
        except Error as error:
            raise self.CollectError(f"its top-level forms do not come to their end: {error}") from None
        for number, (name, seeds, explores, place) in enumerate(tests.tests):
            yield EslTest.from_parent(
                self, name=name.lower(), tests=tests, number=number, seeds=seeds, explores=explores, place=place
            )


class EslTest(pytest.Item):
    """A `deftest`."""

    def __init__(
        self, *, tests: _esl.Tests, number: int, seeds: int, explores: bool, place: str, **rest: Any
    ) -> None:
        super().__init__(**rest)
        self._tests = tests
        self._number = number
        self._seeds = seeds
        self._explores = explores
        self._place = place

    def runtest(self) -> None:
        """Runs the test with each of its seeds, until it fails; once, if it is explored."""
        explores = self._explores or bool(self.config.getoption("--esl-explore"))
        seed = self.config.getoption("--esl-seed")
        seeds = range(1) if explores else range(self._seeds) if seed is None else range(seed, seed + 1)
        for seed in seeds:
            why, text = self._tests.run(self._number, seed, explores)
            if why is None:
                if text:
                    self.add_report_section("call", "exploration", text)
                continue
            again = "" if explores else f"\nrun it again by --esl-seed {seed}"
            raise TestFailed(f"{why}{again}\n{text}")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, TestFailed):
            return f"{self._place}: {excinfo.value}".rstrip()
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Any, Optional[int], str]:
        parts = self._place.rsplit(":", 2)
        line = int(parts[1]) - 1 if len(parts) == 3 and parts[1].isdigit() else None
        return self.path, line, self.name
