"""Run a page as a reader would: its commands and programs, one after the other, in one folder.

Blocks in `console` and `sh` are commands, blocks in `python` are programs that share their names. What a page asks the
reader to do by hand stands in comments, which a browser does not show:

    <!-- write: NAME -->         the block below is the file NAME
    <!-- copy: SOURCE NAME -->   SOURCE of this project is what the reader has then in NAME
    <!-- not run: REASON -->     the block below is not run
    <!-- not run from here: REASON -->   nor is any block after it
"""

import os
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.command_line import run

ROOT = Path(__file__).resolve().parents[2]
COMMANDS, PROGRAMS = ("console", "sh"), ("python",)

_PART = re.compile(
    r"^<!-- (?P<order>write|copy|not run from here|not run): (?P<what>.*?) -->$"
    r"|^```(?P<kind>\w+)\n(?P<text>.*?)^```",
    re.DOTALL | re.MULTILINE,
)


@dataclass(frozen=True)
class Step:
    """One thing that a reader does: ``kind`` is write, copy, not run, or the language of a block."""

    kind: str
    text: str
    name: str = ""


def steps(page: str) -> Iterator[Step]:
    """What a page asks to do, in its order."""
    order, what = "", ""
    for part in _PART.finditer(page):
        if part["order"] == "copy":
            yield Step("copy", part["what"])
        elif part["order"]:
            order, what = part["order"], part["what"]
        elif order == "write":
            yield Step("write", part["text"], what)
            order = ""
        elif order and part["kind"] in (*COMMANDS, *PROGRAMS):
            yield Step("not run", part["text"], what)
            order = order if order == "not run from here" else ""
        else:
            yield Step(part["kind"], part["text"])


def command_lines(block: str) -> Iterator[list[str]]:
    """Commands of a block as words, lines that end in a backslash joined, comments left out."""
    for line in block.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            yield words


def run_page(page: str, names: dict[str, Any] | None = None) -> int:
    """Do all that a page says in the working folder; return how many blocks were run.

    ``names`` are those that the page's programs find, and hold theirs afterwards.
    """
    names = {} if names is None else names
    count = 0
    for step in steps(page):
        if step.kind == "write":
            Path(step.name).write_text(step.text, encoding="utf-8")
        elif step.kind == "copy":
            source, name = step.text.split()
            shutil.copy(ROOT / source, name)
        elif step.kind in COMMANDS:
            for words in command_lines(step.text):
                _do(words)
            count += 1
        elif step.kind in PROGRAMS:
            exec(compile(step.text, "a block of the page", "exec"), names)
            count += 1
    return count


def _files(pattern: str) -> list[str]:
    """What a shell makes of a pattern."""
    return [str(file) for file in sorted(Path().glob(pattern))] or [pattern]


def _do(words: list[str]) -> None:
    """Run one command; a failure names it."""
    if words[0] == "millfrf":
        result = [name for word in words[1:] for name in (_files(word) if "*" in word else [word])]
        assert run(result) == 0, shlex.join(words)
    elif words[:2] == ["python3", "run.py"] and words[2] == "demo":
        assert run(words[2:]) == 0, shlex.join(words)
    elif words[0] == "python" and words[1].startswith("examples/"):
        before, sys.argv = sys.argv, words[1:]
        try:
            runpy.run_path(str(ROOT / words[1]), run_name="__main__")
        finally:
            sys.argv = before
    elif words[0] == "cd":
        os.chdir(words[1])
    else:
        raise AssertionError(
            f"a page asks for {shlex.join(words)}, which no test runs; mark it 'not run' with a reason"
        )
