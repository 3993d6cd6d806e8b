"""The examples in Python of the tasks of the chapter on embedding print what it says."""

import pathlib
import re

import esl
import pytest

CHAPTER = pathlib.Path(__file__).parents[2] / "docs" / "manual" / "embedding.md"
TASKS = re.split("^### ", CHAPTER.read_text().split("\n## Tasks in four languages\n")[1], flags=re.M)[1:]
TASKS = [task for task in TASKS if "```python\n" in task]


@pytest.mark.parametrize("task", TASKS, ids=[task.partition("\n")[0] for task in TASKS])
def test_task(task, capfd):
    code, expected = (re.search(f"```{kind}\n(.*?)```", task, re.S)[1] for kind in ("python", "text"))
    names = {}
    exec(compile(code, str(CHAPTER), "exec"), names)
    names["example"](esl.Engine())
    assert capfd.readouterr().out.strip() == expected.strip()


def test_there_are_tasks():
    assert len(TASKS) == 10
