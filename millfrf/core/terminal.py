"""Output of commands: in words, quietly, or as one JSON document; text of files is shown as it stands."""

import json
import math
import sys
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from pathlib import Path, PurePath
from typing import Any

import typer

_REPLACED = "\N{REPLACEMENT CHARACTER}"


def printable(text: str) -> str:
    """Text without what moves a terminal's cursor or paints it; tab and line feed stay.

    Examples
    --------
    >>> printable("ax \\x1b[31m[g]")
    'ax �[31m[g]'
    """
    return "".join(_REPLACED if unicodedata.category(c) == "Cc" and c not in "\t\n" else c for c in text)


def plain(value: Any) -> Any:
    """Lists, dictionaries, texts, numbers and null; what is not finite is null, a complex number ``[re, im]``.

    Parameters
    ----------
    value
        A result: scalar, array, path, dataclass, or collections of them.

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
        return {str(key): plain(one) for key, one in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    listed = getattr(value, "tolist", None)  # arrays and scalars of NumPy, which is not loaded for `--help`
    return plain(listed()) if callable(listed) else [plain(one) for one in value]


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


def as_it_stands(text: str) -> Any:
    """Text for rich that shows every character as it stands: brackets are brackets, no markup."""
    from rich.text import Text

    return Text(printable(text))


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table to the terminal, every cell as it stands.

    Parameters
    ----------
    title, columns
        Title of the table and its headings; the first column is aligned to the left, the others to the right.
    rows
        Cells of each row.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    drawn = Table(title=as_it_stands(title), box=box.SIMPLE_HEAD, title_justify="left")
    for number, heading in enumerate(columns):
        drawn.add_column(as_it_stands(heading), justify="left" if number == 0 else "right")
    for row in rows:
        drawn.add_row(*map(as_it_stands, row))
    stream = sys.stderr if manner().as_json else sys.stdout
    Console(file=stream, width=None if stream.isatty() else 120, emoji=False).print(drawn)


def progress_bar() -> Any:
    """Make rich's progress bar on standard error, its descriptions as they stand; None where nobody watches."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal or manner().quiet:
        return None
    described = TextColumn("{task.description:<28}", markup=False)
    return Progress(
        described, BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), console=console, transient=True
    )


_WARNING, _NOTE, _WROTE = "warning: ", "note: ", "wrote "


def say(text: str = "") -> None:
    """Print text on standard output, and a line that begins with `warning: ` on standard error.

    Control characters are replaced, because the text may hold names of files and channels. A quiet command leaves out
    lines that begin with `note: ` and, of lines that tell what it wrote, all but what follows the colon. A command
    that answers in JSON prints all lines on standard error.

    Examples
    --------
    >>> say("wrote a\\x1b[2Jb.h5")
    wrote a�[2Jb.h5
    """
    now = manner()
    if text.startswith(_WARNING):
        now.warnings.append(printable(text.removeprefix(_WARNING)))
    elif now.quiet:
        if text.startswith(_NOTE) or (text.startswith(_WROTE) and ": " not in text):
            return
        text = text.removeprefix(_WROTE)
    typer.echo(printable(text), err=now.as_json or text.startswith(_WARNING))


def answer(text: str) -> None:
    """Print text on standard output, a warning too: where warnings are what was asked for.

    Examples
    --------
    >>> answer("warning: ax is dead")
    warning: ax is dead
    """
    now = manner()
    if text.startswith(_WARNING):
        now.warnings.append(printable(text.removeprefix(_WARNING)))
    typer.echo(printable(text), err=now.as_json)


def aside(text: str) -> None:
    """Tell on standard error why one waits; a quiet command does not.

    Parameters
    ----------
    text
        What is to be known, as one sentence without a full stop.
    """
    if not manner().quiet:
        typer.echo(printable(f"{_NOTE}{text}"), err=True)


def note(text: str) -> None:
    """Tell what is going on; a quiet command does not.

    Examples
    --------
    >>> note("milling three sweeps ...")
    milling three sweeps ...
    """
    now = manner()
    if not now.quiet:
        typer.echo(printable(text), err=now.as_json)


def print_document(command: str, chosen: Manner, written: list[Path]) -> None:
    """Print the one JSON document of a command, see `document`."""
    typer.echo(document(command, chosen, written))


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
    """Print a table to the terminal."""
    print_table(table.title, table.columns, table.rows)
