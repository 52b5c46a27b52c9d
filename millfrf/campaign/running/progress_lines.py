"""Progress of a run: on a terminal one line that moves, elsewhere a line now and then."""

import sys
import time
from collections.abc import Collection, Mapping
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
    expected : s
        Time that each task is believed to take, by its identity.
    measured
        Kinds of which earlier runs of this campaign told the time; of others it is not known before one has ended.
    """

    expected: Mapping[str, float]
    measured: Collection[str] = ()
    done: int = 0
    refused: int = 0
    failed: int = 0
    _left: dict[str, float] = field(default_factory=dict)
    _number: dict[str, float] = field(default_factory=dict)
    _believed: dict[str, float] = field(default_factory=dict)
    _taken: dict[str, float] = field(default_factory=dict)
    _started: float = field(default_factory=time.monotonic)
    _told: float = field(default_factory=time.monotonic)
    _bar: Any = None

    def __post_init__(self) -> None:
        for identity, seconds in self.expected.items():
            _add(self._left, identity, seconds)
            _add(self._number, identity, 1)

    def ended(self, ended: Ended) -> None:
        """Count one task."""
        self.done += 1
        self.refused += ended.status == REFUSED
        self.failed += ended.status not in (DONE, REFUSED)
        _add(self._left, ended.identity, -self.expected[ended.identity])
        _add(self._number, ended.identity, -1)
        if ended.status == DONE:
            _add(self._believed, ended.identity, self.expected[ended.identity])
            _add(self._taken, ended.identity, ended.seconds)

    def line(self, workers: int) -> str:
        """Where the run stands, in one line."""
        elapsed = max(time.monotonic() - self._started, 1e-3)
        text = f"{self.done} of {len(self.expected)} tasks, {self.done / elapsed:.2g}/s, {self.refused} refused"
        if self.failed:
            text += f", {self.failed} failed"
        if not workers:
            text += ", no worker is there: waiting for one"
        elif 0 < self.done < len(self.expected):
            text += f", {self._time_left(workers)}"
        return text

    def _time_left(self, workers: int) -> str:
        """Time of the kinds that were met or measured before, at their pace; and the kinds that nothing is known of."""
        paces = dict.fromkeys(self.measured, 1.0)
        paces |= {kind: self._taken[kind] / one for kind, one in self._believed.items() if one > 0}
        open_kinds = [kind for kind, number in self._number.items() if number > 0 and kind not in paces]
        seconds = sum(max(left, 0.0) * paces[kind] for kind, left in self._left.items() if kind in paces)
        beside = f"how long {', '.join(open_kinds)} will take is not known yet"
        if not open_kinds:
            return f"about {shown_time(seconds / workers)} left"
        if not any(number > 0 for kind, number in self._number.items() if kind in paces):
            return beside
        return f"about {shown_time(seconds / workers)} left for what was met; {beside}"

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
            self._bar.add_task("campaign", total=len(self.expected))
        self._bar.update(0, completed=self.done, description=self.line(workers))

    def stop(self) -> None:
        """Take the moving line away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _add(sums: dict[str, float], identity: str, seconds: float) -> None:
    kind = identity.partition(":")[0]
    sums[kind] = sums.get(kind, 0.0) + seconds


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
