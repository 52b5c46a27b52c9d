"""Output of commands: in words, quietly, or as one JSON document.

Steps print through this module. Outside of a command nothing is printed: a function called from Python returns its
result, and its warnings are warnings of Python. Text of files and users is printed literally: it can neither move the
cursor nor be interpreted as markup.
"""

import json
import math
import os
import re
import sys
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from pathlib import Path, PurePath
from typing import Any, TextIO

from .errors import MillfrfWarning
from .whole_files import require_as_written

FORMAT = "millfrf.answer"


@dataclass
class Manner:
    """Settings of the running command's output, and its answer so far."""

    silent: bool = False  # nothing is printed: no command is running
    quiet: bool = False  # no progress, no notes
    as_json: bool = False  # one JSON document is the only text on standard output
    answers: dict[str, Any] = field(default_factory=dict)  # fields of the document
    warnings: list[str] = field(default_factory=list)
    exit_code: int = 0  # unless an error ends the command


_manner: ContextVar[Manner | None] = ContextVar("manner", default=None)


def manner() -> Manner:
    """Return the output settings of the running command; outside of a command, settings that print nothing."""
    return _manner.get() or Manner(silent=True)


@contextmanager
def speaking(*, quiet: bool = False, as_json: bool = False) -> Iterator[Manner]:
    """Print within a block, as a command does."""
    chosen = Manner(quiet=quiet, as_json=as_json)
    token = _manner.set(chosen)
    try:
        yield chosen
    finally:
        _manner.reset(token)


@contextmanager
def silently() -> Iterator[None]:
    """Print nothing within a block, so that a step that calls other steps prints only one answer."""
    token = _manner.set(Manner(silent=True))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MillfrfWarning)  # the files that the steps write contain them
            yield
    finally:
        _manner.reset(token)


def printable(text: str) -> str:
    """Remove control characters, which would control the terminal, from a text; keep tabs and line feeds.

    Examples
    --------
    >>> printable("ax \\x1b[31m[g]")
    'ax �[31m[g]'
    """
    replacement = "\N{REPLACEMENT CHARACTER}"
    return "".join(replacement if unicodedata.category(c) == "Cc" and c not in "\t\n" else c for c in text)


def say(text: str = "") -> None:
    """Print a line of the answer on standard output; if the command answers in JSON, on standard error."""
    now = manner()
    if not now.silent:
        put(printable(text), sys.stderr if now.as_json else sys.stdout)


def put(text: str, stream: TextIO) -> None:
    """Print a line; a reader that stops, as ``head`` does, ends no command: its files are still to be written."""
    try:
        print(text, file=stream, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say_written(paths: Iterable[object], text: str = "") -> None:
    """Print the names of written files with a short description; a quiet command prints only the description.

    Examples
    --------
    >>> with speaking():
    ...     say_written(["frf.h5"], "receptance, 800 lines")
    wrote frf.h5: receptance, 800 lines

    Raises
    ------
    DiskError
        One of them is not what the command has written.
    """
    paths = list(paths)
    require_as_written(paths)
    listed = " and ".join(map(str, paths))
    if manner().quiet:
        if text:
            say(f"{listed}: {text}")
    else:
        say(f"wrote {listed}" + (f": {text}" if text else ""))


def note(text: str) -> None:
    """Print a line about the work, unless the command is quiet."""
    if not manner().quiet:
        say(text)


def aside(text: str) -> None:
    """Print one sentence without a full stop as a note on standard error, unless the command is quiet."""
    now = manner()
    if not (now.quiet or now.silent):
        print(f"note: {printable(text)}", file=sys.stderr)


def say_progress(description: str, done: int, total: int) -> None:
    """Print the progress of a work as a line on standard error, for a program that runs the command.

    Examples
    --------
    >>> from contextlib import redirect_stderr
    >>> with redirect_stderr(sys.stdout):
    ...     say_progress("finding taps", 3, 10)
    progress: finding taps 3/10
    """
    print(f"progress: {printable(description)} {done}/{total}", file=sys.stderr, flush=True)


STACK_LEVEL = 4
"""Frames from ``warnings.warn`` to the line that called a step: `warn`, the step, its wrapper, the caller."""


_FILES = re.compile(r"(?:[^:]{1,80}?\.[A-Za-z]\w{1,4}: )*")  # "model.json: frf.h5: "
_NUMBERS = re.compile(r"(?<![\w.])[-+]?\d[\d.e+-]*")


def grouped(doubts: Iterable[str]) -> list[str]:
    """Join doubts that say the same, in the order in which they first appear.

    A result repeats the doubts of the files from which it was made, "model.json: frf.h5: ...": each is given once, with
    the file in which it arose. Doubts of several files that differ in numbers only become one: the first in full, then
    the names of the other files.

    Examples
    --------
    >>> grouped(["a.h5: hum at 50 Hz", "frf.h5: a.h5: hum at 50 Hz", "b.h5: hum at 60 Hz", "a.h5: no force"])
    ['a.h5: hum at 50 Hz (likewise b.h5)', 'a.h5: no force']
    >>> grouped(["a.h5: hum at 50 Hz", "hum at 60 Hz"])
    ['a.h5: hum at 50 Hz']
    """
    groups: dict[str, dict[tuple[str, str], None]] = {}
    for doubt in doubts:
        files = _FILES.match(doubt)
        end = 0 if files is None else files.end()
        text = doubt[end:]
        members = groups.setdefault(_NUMBERS.sub("#", text), {})
        if ("", text) not in members:
            members[doubt[:end].removesuffix(": ").split(": ")[-1], text] = None
    joined = []
    for members in groups.values():
        first = next(iter(members))[0]
        same = [f"{first}: {text}" if first else text for file, text in members if file == first]
        others = ", ".join(dict.fromkeys(file for file, _ in members if file not in ("", first)))
        joined += [same[0] + (f" (likewise {others})" if others else ""), *same[1:]]
    return joined


def warn(sentences: Iterable[str], stack_level: int = STACK_LEVEL) -> None:
    """Print doubts, :func:`grouped`, as warnings on standard error; outside of a command, issue Python warnings."""
    now = manner()
    for sentence in grouped(sentences):
        if now.silent:
            warnings.warn(sentence, MillfrfWarning, stacklevel=stack_level)
        else:
            now.warnings.append(printable(sentence))
            print(f"warning: {printable(sentence)}", file=sys.stderr)


def say_concern(text: str) -> None:
    """Print a warning on standard output, for commands whose answer is a list of warnings."""
    manner().warnings.append(printable(text))
    say(f"warning: {text}")


def tell(make: Callable[[], Mapping[str, Any]]) -> None:
    """Add fields to the JSON document of a command; ``make`` is called only with ``--json``.

    Values are plain values, arrays or paths; a key ends with its unit (``frequency_hz``).
    """
    if manner().as_json:
        manner().answers.update(make())


def print_document(command: str, chosen: Manner, written: Sequence[Path]) -> None:
    """Print the JSON document of a command, without NaN: format, command, fields, warnings, and files written."""
    content = {
        "format": FORMAT,
        "format_version": 1,
        "command": command,
        **chosen.answers,
        "warnings": chosen.warnings,
        "written": [str(path) for path in written],
    }
    put(json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False), sys.stdout)


def plain(value: Any) -> Any:
    """Convert a scalar, array, path, dataclass or collection to JSON: NaN is null, a complex number ``[re, im]``.

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
    """A title, column headings with units, and rows of text."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def show(table: Table) -> None:
    """Print a table with literal cells: the first column is left-aligned, all further columns are right-aligned."""
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
    console = Console(file=stream, width=None if stream.isatty() else 120, emoji=False)
    with console.capture() as captured:
        console.print(drawn, end="")
    put(captured.get(), stream)
