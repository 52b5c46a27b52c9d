"""Progress of a run: on a terminal one line that moves, elsewhere a line now and then."""

import sys
import time
from dataclasses import dataclass, field
from typing import Any

from ...terminal import printable, progress_bar
from .one_task import DONE, REFUSED, Ended

EVERY = 20.0
"""Seconds between two lines where nobody watches a terminal."""


@dataclass
class ProgressLines:
    """Counts tasks as they end, and tells how many are done, how fast, and how long it still takes.

    Parameters
    ----------
    total
        Number of tasks that are left.
    seconds : s
        Time that all of them take together, on one worker.
    """

    total: int
    seconds: float
    done: int = 0
    refused: int = 0
    failed: int = 0
    _spent: float = 0.0
    _worked: float = 0.0
    _started: float = field(default_factory=time.monotonic)
    _told: float = field(default_factory=time.monotonic)
    _bar: Any = None

    def ended(self, ended: Ended, expected: float) -> None:
        """Count one task; ``expected`` (s) is the time that it was believed to take."""
        self.done += 1
        self.refused += ended.status == REFUSED
        self.failed += ended.status not in (DONE, REFUSED)
        self._spent += expected
        self._worked += ended.seconds

    def line(self, workers: int) -> str:
        """Where the run stands, in one line."""
        elapsed = max(time.monotonic() - self._started, 1e-3)
        text = f"{self.done} of {self.total} tasks, {self.done / elapsed:.2g}/s, {self.refused} refused"
        if self.failed:
            text += f", {self.failed} failed"
        if self.done and self.done < self.total:
            pace = self._worked / self._spent if self._spent > 0 else 1.0
            text += f", about {shown_time(pace * max(self.seconds - self._spent, 0.0) / workers)} left"
        return text

    def show(self, workers: int) -> None:
        """Show where the run stands, if it is time to."""
        now = time.monotonic()
        if now - self._told < (0.2 if sys.stderr.isatty() else EVERY):
            return
        self._told = now
        if sys.stderr.isatty():
            self._move(workers)
        else:
            sys.stderr.write(f"{printable(self.line(workers))}\n")
            sys.stderr.flush()

    def _move(self, workers: int) -> None:
        if self._bar is None:
            self._bar = progress_bar()
            self._bar.start()
            self._bar.add_task("campaign", total=self.total)
        self._bar.update(0, completed=self.done, description=self.line(workers))

    def stop(self) -> None:
        """Take the moving line away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def shown_time(seconds: float) -> str:
    """A time as people say it.

    Examples
    --------
    >>> shown_time(40), shown_time(200), shown_time(9000), shown_time(4e5)
    ('40 s', '3 min', '2.5 h', '4.6 days')
    """
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 48 * 3600 else f"{seconds / 86400:.1f} days"
