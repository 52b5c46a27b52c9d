"""The terminal: the one place where text of files and users meets rich, which would read `[x]` in it as markup."""

import sys
from collections.abc import Sequence
from typing import Any

from .control_characters import printable
from .manners import manner


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
