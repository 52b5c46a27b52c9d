"""How a command speaks: in words, quietly, or as one JSON document for a script."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .plain_values import plain

FORMAT = "millfrf.answer"


@dataclass
class Manner:
    """How the command at hand speaks, and what it has said for a script.

    Parameters
    ----------
    quiet
        Whether progress and notes are left out.
    as_json
        Whether one JSON document is the only thing on standard output.
    answers
        Fields of the document.
    warnings
        Warnings so far.
    """

    quiet: bool = False
    as_json: bool = False
    answers: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


_manner: ContextVar[Manner | None] = ContextVar("manner", default=None)


def manner() -> Manner:
    """How the command at hand speaks; outside a command, in words."""
    return _manner.get() or Manner()


@contextmanager
def speaking(*, quiet: bool = False, as_json: bool = False) -> Iterator[Manner]:
    """Let a block speak in a manner.

    Parameters
    ----------
    quiet
        Whether progress and notes are left out.
    as_json
        Whether one JSON document is the only thing on standard output.
    """
    chosen = Manner(quiet, as_json)
    token = _manner.set(chosen)
    try:
        yield chosen
    finally:
        _manner.reset(token)


def tell(make: Callable[[], Mapping[str, Any]]) -> None:
    """Add fields to the document of a command that was asked for JSON; otherwise nothing is made.

    Parameters
    ----------
    make
        Gives the fields: plain values, arrays or paths, with the unit at the end of each key (``frequency_hz``).
    """
    chosen = _manner.get()
    if chosen is not None and chosen.as_json:
        chosen.answers.update(make())


def document(command: str, chosen: Manner, written: list[Path]) -> str:
    """The document as text: format, command, its fields, warnings, files written; no NaN.

    Parameters
    ----------
    command
        Words of the command.
    chosen
        What was said.
    written
        Files that the command wrote.
    """
    content = {
        "format": FORMAT,
        "format_version": 1,
        "command": command,
        **chosen.answers,
        "warnings": chosen.warnings,
        "written": [str(path) for path in written],
    }
    return json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False)
