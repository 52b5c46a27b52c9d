"""Every command that a page shows is one that the program takes: its words, its options and what they take."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from millfrf.command_line import parse
from millfrf.commands import words_of

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]
PARTS = re.compile(r"\[[^\]]*\]|\.\.\.")
"""What may be left out, and "and so on": signs that a page uses, and no command knows."""


def _shown(page: Path) -> Iterator[list[str]]:
    """Command lines in blocks, fenced or indented, as words."""
    lines = page.read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    fence = ""
    for line in lines:
        if line.startswith("```"):
            fence = "" if fence else line
        elif fence not in ("", "```text") or (not fence and line.startswith("    ")):
            typed = re.sub(r"^\s*(\$ |/\S*/)?", "", line)
            if typed.startswith("millfrf ") and not typed.startswith("millfrf >"):
                yield shlex.split(PARTS.sub("", typed), comments=True)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_the_program_takes_every_command_of_a_page(page: Path) -> None:
    for typed in _shown(page):
        words = words_of(typed[1:])
        assert words, f"{page.name}: there is no command {shlex.join(typed)}"
        try:
            if "--help" not in typed:
                parse(words, typed[1 + len(words.split()) :])
        except Exception as error:
            raise AssertionError(f"{page.name}: {shlex.join(typed)}: {error}") from error


def test_pages_show_many_commands() -> None:
    assert sum(len(list(_shown(page))) for page in PAGES) > 100
