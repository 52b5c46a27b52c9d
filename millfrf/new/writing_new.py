"""`write_new`: the one place where a template becomes a file."""

from pathlib import Path

from millfrf.core import writing_whole_file


def write_new(out: Path, text: str) -> None:
    """Write a template whole."""
    with writing_whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
