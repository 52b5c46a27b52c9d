"""`say`, `answer`, `note`: lines of a command, as they stand; names from files cannot move the cursor."""

from pathlib import Path

import typer

from .control_characters import printable
from .manners import Manner, document, manner

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
