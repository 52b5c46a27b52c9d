"""Progress bars on standard error for work that takes over two seconds; none where nobody watches."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

from .terminal import printable, progress_bar

QUIET_FOR = 1.0
"""A bar appears only after this many seconds."""

Update = Callable[[int], None]


class Progress(Protocol):
    """Callable that opens a bar: ``with progress("estimating", total) as update: update(done)``."""

    def __call__(self, description: str, total: int | None = None) -> AbstractContextManager[Update]:
        """Open a bar for one job; with total None it only shows that work goes on."""


@contextmanager
def silent(description: str, total: int | None = None) -> Iterator[Update]:
    """Show no bar: for libraries and tests."""
    del description, total
    yield _ignore


def _ignore(done: int) -> None:
    del done


@contextmanager
def bar(description: str, total: int | None = None) -> Iterator[Update]:
    """Show a bar that appears after a second and vanishes when the job is done."""
    shown_bar = progress_bar()
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
