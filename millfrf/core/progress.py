"""Progress bars on standard error for work that takes over a second, while a command runs on a terminal."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from .terminal import manner, printable, say_progress

QUIET_FOR = 1.0
"""A bar appears only after this many seconds."""

AS_LINES = "MILLFRF_PROGRESS_LINES"
"""Environment variable: a program that runs a command reads its progress as lines ``progress: taps 3/10``.

Work of unknown amount is ``0/0``.
"""

Update = Callable[[int], None]


@contextmanager
def progress(description: str, total: int | None = None) -> Iterator[Update]:
    """Show a progress bar after one second, and remove it when the work is done.

    No bar is shown outside of a command, by a quiet command, or if standard error is no terminal.

    Parameters
    ----------
    description
        What is being done.
    total
        Amount of work; None: the bar only shows that work goes on.

    Yields
    ------
    callable
        Takes the amount of work that is done.
    """
    now = manner()
    if os.environ.get(AS_LINES) and not now.silent:
        yield _lines(description, total or 0)
        return
    shown_bar = None if now.silent or now.quiet else progress_bar()
    if shown_bar is None:
        yield _ignore
        return
    task = shown_bar.add_task(printable(description), total=total)
    started, shown = time.monotonic(), total is None
    if shown:
        shown_bar.start()

    def update(done: int) -> None:
        nonlocal shown
        if not shown and time.monotonic() - started > QUIET_FOR:
            shown = True
            shown_bar.start()
        shown_bar.update(task, completed=done)

    try:
        yield update
    finally:
        if shown:
            shown_bar.stop()


def _lines(description: str, total: int) -> Update:
    """Return a function that prints the progress as lines, at most one for each per cent."""
    last = -1

    def update(done: int) -> None:
        nonlocal last
        if (percent := 100 * done // max(total, 1)) > last:
            last = percent
            say_progress(description, done, total)

    update(0)
    return update


def _ignore(done: int) -> None:
    del done


def progress_bar() -> Any:
    """Make a progress bar of rich on standard error, with literal descriptions; None if no bar is to be shown."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        return None
    described = TextColumn("{task.description:<28}", markup=False)
    return Progress(
        described, BarColumn(), TaskProgressColumn(), TimeRemainingColumn(), console=console, transient=True
    )
