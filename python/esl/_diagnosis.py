"""Errors of texts that do not compile, with their diagnostics as data."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Optional, Union

from . import _esl
from .errors import CompileError, Diagnostic, Failure, diagnostics_of


def _refused(error: BaseException, name: str, text: str, file: Optional[Path]) -> BaseException:
    is_refused = isinstance(error, CompileError) or (isinstance(error, Failure) and error.cause == ":READER-ERROR")
    if not is_refused or (isinstance(error, CompileError) and error.diagnostics):
        return error
    errors: list[Diagnostic] = [
        found for found in diagnostics_of(_esl.check(name, text, file)) if found.severity == "error"
    ]
    return CompileError(str(error), errors) if errors else error


def error_of(error: BaseException, text: str) -> BaseException:
    """Returns the error of an evaluation of a text, with diagnostics if the text does not compile."""
    return _refused(error, "<text>", text, None)


def error_of_file(error: BaseException, path: Union[str, "os.PathLike[str]"]) -> BaseException:
    """Returns the error of a load of a file, with diagnostics if the file does not compile."""
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, ValueError):
        return error
    return _refused(error, str(file), text, file)
