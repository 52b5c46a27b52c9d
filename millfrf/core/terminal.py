"""Output of commands: in words, quietly, or as one JSON document.

Steps say what they do through this module. Outside of a command nothing is printed: a function called from Python
returns its result, and its warnings are warnings of Python. Text of files and users is shown as it stands: it can
neither move the cursor nor be read as markup.
"""

import json
import math
import sys
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from pathlib import Path, PurePath
from typing import Any

from .errors import MillfrfWarning

FORMAT = "millfrf.answer"


@dataclass
class Manner:
    """How the running command prints, and what it has answered so far.

    Parameters
    ----------
    silent
        Whether nothing is printed: no command is running.
    quiet
        Whether progress and notes are left out.
    as_json
        Whether one JSON document is the only thing on standard output.
    answers
        Fields of the document.
    warnings
        Warnings so far.
    exit_code
        Exit code of the command, unless an error ends it.
    """

    silent: bool = False
    quiet: bool = False
    as_json: bool = False
    answers: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    exit_code: int = 0


_manner: ContextVar[Manner | None] = ContextVar("manner", default=None)


def manner() -> Manner:
    """How the running command prints; outside of a command, silently."""
    return _manner.get() or Manner(silent=True)


@contextmanager
def speaking(*, quiet: bool = False, as_json: bool = False) -> Iterator[Manner]:
    """Print from within a block, as a command does.

    Parameters
    ----------
    quiet
        Whether progress and notes are left out.
    as_json
        Whether one JSON document is the only thing on standard output.
    """
    chosen = Manner(quiet=quiet, as_json=as_json)
    token = _manner.set(chosen)
    try:
        yield chosen
    finally:
        _manner.reset(token)


@contextmanager
def silently() -> Iterator[None]:
    """Print nothing from within a block: a step that calls other steps prints an answer of its own."""
    token = _manner.set(Manner(silent=True))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MillfrfWarning)  # they stand in the files that the steps write
            yield
    finally:
        _manner.reset(token)


def printable(text: str) -> str:
    """Text without control characters, which move or paint a terminal's cursor; tab and line feed stay.

    Examples
    --------
    >>> printable("ax \\x1b[31m[g]")
    'ax �[31m[g]'
    """
    replacement = "\N{REPLACEMENT CHARACTER}"
    return "".join(replacement if unicodedata.category(c) == "Cc" and c not in "\t\n" else c for c in text)


def say(text: str = "") -> None:
    """Print a line of the answer on standard output; of a command that answers in JSON, on standard error."""
    now = manner()
    if not now.silent:
        print(printable(text), file=sys.stderr if now.as_json else sys.stdout)


def say_written(paths: Iterable[object], text: str = "") -> None:
    """Tell which files were written; a quiet command prints only what is said of them.

    Parameters
    ----------
    paths
        Names of the files.
    text
        Short description of their content.

    Examples
    --------
    >>> with speaking():
    ...     say_written(["frf.h5"], "receptance, 800 lines")
    wrote frf.h5: receptance, 800 lines
    """
    listed = " and ".join(map(str, paths))
    if manner().quiet:
        if text:
            say(f"{listed}: {text}")
    else:
        say(f"wrote {listed}" + (f": {text}" if text else ""))


def note(text: str) -> None:
    """Print what is going on; a quiet command does not."""
    if not manner().quiet:
        say(text)


def aside(text: str) -> None:
    """Print a note on standard error; a quiet command does not.

    Parameters
    ----------
    text
        One sentence without a full stop.
    """
    now = manner()
    if not (now.quiet or now.silent):
        print(f"note: {printable(text)}", file=sys.stderr)


STACK_LEVEL = 4
"""Frames from ``warnings.warn`` to the line that called a step: `warn`, the step, its wrapper, the caller."""


def warn(doubts: Iterable[str], stack_level: int = STACK_LEVEL) -> None:
    """Warn of each doubt once: a command prints lines on standard error, a function warns as Python does.

    Parameters
    ----------
    doubts
        Sentences.
    stack_level
        Frames up to the line that is named by Python's warning.
    """
    now = manner()
    for doubt in dict.fromkeys(doubts):
        if now.silent:
            warnings.warn(doubt, MillfrfWarning, stacklevel=stack_level)
        else:
            now.warnings.append(printable(doubt))
            print(f"warning: {printable(doubt)}", file=sys.stderr)


def say_concern(text: str) -> None:
    """Print a warning on standard output, where warnings are what was asked for."""
    manner().warnings.append(printable(text))
    say(f"warning: {text}")


def tell(make: Callable[[], Mapping[str, Any]]) -> None:
    """Add fields to the JSON document of a command; without ``--json`` they are not computed.

    Parameters
    ----------
    make
        Gives the fields: plain values, arrays or paths, with the unit at the end of each key (``frequency_hz``).
    """
    if manner().as_json:
        manner().answers.update(make())


def print_document(command: str, chosen: Manner, written: Sequence[Path]) -> None:
    """Print the one JSON document of a command: format, command, its fields, warnings, files written; no NaN.

    Parameters
    ----------
    command
        Words of the command.
    chosen
        Answers and warnings of the command.
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
    print(json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False))


def plain(value: Any) -> Any:
    """A result as values of JSON: what is not finite is null, a complex number ``[re, im]``.

    Parameters
    ----------
    value
        Scalar, array, path, dataclass, or collections of them.

    Examples
    --------
    >>> plain({"depth_m": float("nan"), "poles": (1 + 2j,)})
    {'depth_m': None, 'poles': [[1.0, 2.0]]}
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, str | PurePath):
        return str(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    listed = getattr(value, "tolist", None)
    return plain(listed()) if callable(listed) else [plain(item) for item in value]


@dataclass(frozen=True)
class Table:
    """A title, column headings and rows of text.

    Parameters
    ----------
    title
        Title of the table, one line.
    columns
        Headings with units.
    rows
        Rows of text, with as many cells as there are columns.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def show(table: Table) -> None:
    """Print a table, every cell as it stands: the first column to the left, the others to the right."""
    if manner().silent:
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    drawn = RichTable(title=Text(printable(table.title)), box=box.SIMPLE_HEAD, title_justify="left")
    for number, heading in enumerate(table.columns):
        drawn.add_column(Text(printable(heading)), justify="left" if number == 0 else "right")
    for row in table.rows:
        drawn.add_row(*(Text(printable(cell)) for cell in row))
    stream = sys.stderr if manner().as_json else sys.stdout
    Console(file=stream, width=None if stream.isatty() else 120, emoji=False).print(drawn)
