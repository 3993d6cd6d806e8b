"""ESL in IPython and in notebooks: `%load_ext esl.ipython` gives the magics `%esl` and `%%esl`.

    %%esl
    (defun survey () (loop for leg from 1 to 3 sum (drive (* 10 leg))))

    %esl (survey)

They evaluate in an engine of their own, which is `engine` of the namespace if that has one: so functions of Python that
were defined there can be called. Tab completes names of the program.
"""

from __future__ import annotations

import argparse
import re
import shlex
from typing import Any, Optional

from .engine import Engine
from .errors import Error, Failure

# Characters of names, for completion.
NAME = re.compile(r"[^\s()'`,\";#]*$")


class _Options(argparse.ArgumentParser):
    def error(self, message: str) -> Any:
        raise ValueError(f"%%esl: {message}")


def _options() -> argparse.ArgumentParser:
    options = _Options(prog="%%esl", add_help=False)
    options.add_argument("--timeline", action="store_true", help="show a drawing of the run")
    options.add_argument("--tasks", action="store_true", help="show the tasks that are left")
    options.add_argument("--engine", metavar="NAME", default="engine", help="the variable of the engine")
    options.add_argument("--out", metavar="NAME", help="a variable that gets the value")
    return options


class EslMagics:
    """The magics of one session of IPython."""

    def __init__(self, shell: Any) -> None:
        self._shell = shell

    def engine(self, name: str = "engine") -> Engine:
        """Returns the engine in a variable of the namespace, which is made if it is not there."""
        found = self._shell.user_ns.get(name)
        if isinstance(found, Engine):
            return found
        if found is not None:
            raise TypeError(f"`{name}` is not an engine: name another variable by `%%esl --engine NAME`")
        made = Engine(output=_print)
        self._shell.user_ns[name] = made
        return made

    def magic(self, line: str, cell: Optional[str] = None) -> Any:
        """Evaluates the forms of a line or a cell, and returns the first value of the last.

        Options of a cell: --timeline shows a drawing of the run, --tasks the tasks that are left; --engine NAME names the
        variable of the engine, --out NAME one that gets the value.
        """
        if cell is None:
            return self._evaluate(self.engine(), line)
        options = _options().parse_args(shlex.split(line))
        engine = self.engine(options.engine)
        if options.timeline:
            with engine.timeline() as timeline:
                value = self._evaluate(engine, cell)
            _display(timeline)
        else:
            value = self._evaluate(engine, cell)
        if options.tasks:
            _display(engine.tasks())
        if options.out:
            self._shell.user_ns[options.out] = value
            return None
        return value

    @staticmethod
    def _evaluate(engine: Engine, text: str) -> Any:
        try:
            return engine.eval(text)
        except Failure as failure:
            # The report has the frames of the program; those of Python here tell nothing.
            raise Failure(failure.cause, failure.arguments, failure.report.strip()) from None
        except Error as error:
            raise error from None

    def completions(self, cell: str, line: str) -> tuple[str, list[str]]:
        """Returns the beginning of a name at the end of a line in a cell with ESL, and the names that begin so."""
        if not cell.lstrip().startswith(("%esl", "%%esl")):
            return "", []
        found = NAME.search(line)
        prefix = found.group() if found else ""
        if not prefix or prefix.startswith("%"):
            return "", []
        return prefix, [name for name, _ in self.engine().completions(prefix)]


def _print(text: str) -> None:
    print(text, end="")


def _display(shown: Any) -> None:
    from IPython import display

    # Without types, like all of that module.
    show: Any = display.display
    show(shown)


def load_ipython_extension(shell: Any) -> None:
    """Gives a session of IPython the magics and the completion."""
    from IPython.core.completer import SimpleCompletion, context_matcher

    magics = EslMagics(shell)
    shell.register_magic_function(magics.magic, "line_cell", "esl")

    @context_matcher()  # type: ignore[untyped-decorator, unused-ignore]
    def esl_matcher(context: Any) -> Any:
        prefix, names = magics.completions(context.full_text, context.text_until_cursor)
        return {
            "completions": [SimpleCompletion(text=name, type="function") for name in names],
            "matched_fragment": prefix,
            "suppress": bool(names),
        }

    shell.Completer.custom_matchers.append(esl_matcher)
