"""`say`, `answer`: lines of a command, as they stand; names from files cannot move the cursor or paint the screen."""

import typer

from .rich_output import printable

_WARNING = "warning: "


def say(text: str = "") -> None:
    """Print text on standard output, and a line that begins with `warning: ` on standard error.

    Control characters are replaced, because the text may hold names of files and channels.

    Examples
    --------
    >>> say("wrote a\\x1b[2Jb.h5")
    wrote a�[2Jb.h5
    """
    typer.echo(printable(text), err=text.startswith(_WARNING))


def answer(text: str) -> None:
    """Print text on standard output, a warning too: where warnings are what was asked for.

    Examples
    --------
    >>> answer("warning: ax is dead")
    warning: ax is dead
    """
    typer.echo(printable(text))
