"""Progress bars on standard error for whatever takes over two seconds; silent where nobody watches."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

QUIET_FOR = 1.0
"""A bar appears only after this many seconds."""

Update = Callable[[int], None]


class Watch(Protocol):
    """Opens a bar: ``with watch("estimating", total) as update: update(done)``."""

    def __call__(self, description: str, total: int | None = None) -> AbstractContextManager[Update]:
        """A bar for one job; total None: one that only shows that work goes on."""


@contextmanager
def silent(description: str, total: int | None = None) -> Iterator[Update]:
    """No bar at all: for libraries and tests."""
    del description, total
    yield _ignore


def _ignore(done: int) -> None:
    del done


@contextmanager
def bar(description: str, total: int | None = None) -> Iterator[Update]:
    """A bar that appears after a second and vanishes when the job is done."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _ignore
        return
    columns = (TextColumn("{task.description:<28}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=console, transient=True)
    task = progress.add_task(description, total=total)
    started, shown = time.monotonic(), total is None
    if shown:
        progress.start()

    def update(done: int) -> None:
        nonlocal shown
        if not shown and time.monotonic() - started > QUIET_FOR:
            shown = True
            progress.start()
        progress.update(task, completed=done)

    try:
        yield update
    finally:
        if shown:
            progress.stop()
