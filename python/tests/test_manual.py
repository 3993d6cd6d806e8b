"""The examples of the chapter on Python print what it says."""

import io
import pathlib
import re
from contextlib import redirect_stdout

CHAPTER = pathlib.Path(__file__).parents[2] / "docs" / "manual" / "python.md"


def test_examples():
    names = {}
    examples = re.findall(r"```python\n(.*?)```\n```text\n(.*?)```", CHAPTER.read_text(), re.S)
    assert len(examples) == 8
    for code, expected in examples:
        printed = io.StringIO()
        with redirect_stdout(printed):
            exec(compile(code, str(CHAPTER), "exec"), names)
        assert printed.getvalue() == expected
