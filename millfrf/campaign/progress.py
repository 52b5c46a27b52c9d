"""Progress of a run, and how long its tasks take."""

import csv
import sys
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from millfrf.core.progress import progress_bar
from millfrf.core.terminal import printable

from .running import DONE, REFUSED, Ended
from .tasks import Task

KEPT = "tasks.csv"
COLUMNS = ("task", "status", "seconds", "megabytes")

DEFAULTS: Mapping[str, tuple[float, float]] = {
    "check": (0.03, 0.01),
    "spectra": (0.04, 0.03),
    "join": (0.04, 0.0),
    "sum": (0.04, 0.0),
    "estimate": (0.15, 0.0),
    "fit": (1.2, 2.8),
    "calibrate": (0.4, 0.0),
    "lobes": (1.0, 0.0),
    "diagnose": (30.0, 10.0),
    "robot_diagnose": (30.0, 10.0),
    "learn": (30.0, 0.0),
    "report": (20.0, 0.0),
}
"""Seconds a task, and seconds a megabyte of recordings, on one core; docs/campaigns.md says where from."""


@dataclass(frozen=True)
class Rates:
    """Seconds by kind of task.

    Parameters
    ----------
    each, megabyte : s
        Seconds a task, and seconds a megabyte that it reads, by kind.
    measured
        Kinds whose rates come from earlier runs of this campaign.
    """

    each: Mapping[str, float]
    megabyte: Mapping[str, float]
    measured: frozenset[str]

    def seconds(self, task: Task, megabytes: float) -> float:
        """Time that a task takes, s."""
        return self.each[task.kind] + self.megabyte[task.kind] * megabytes


def measured_rates(out: Path) -> Rates:
    """Rates from the log of earlier runs; of kinds that it does not know the defaults.

    A kind's time a task and its time a megabyte are scaled together, so that the defaults' sum over the tasks that were
    done is the time that they took.
    """
    taken: dict[str, float] = {}
    expected: dict[str, float] = {}
    with suppress(OSError, ValueError, KeyError), (out / "logs" / KEPT).open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            kind = row["task"].partition(":")[0]
            if row["status"] == DONE and kind in DEFAULTS:
                each, megabyte = DEFAULTS[kind]
                taken[kind] = taken.get(kind, 0.0) + float(row["seconds"])
                expected[kind] = expected.get(kind, 0.0) + each + megabyte * float(row["megabytes"])
    scale = {kind: taken[kind] / expected[kind] if expected.get(kind) else 1.0 for kind in DEFAULTS if kind in taken}
    return Rates(
        {kind: each * scale.get(kind, 1.0) for kind, (each, _) in DEFAULTS.items()},
        {kind: megabyte * scale.get(kind, 1.0) for kind, (_, megabyte) in DEFAULTS.items()},
        frozenset(scale),
    )


def note_time(out: Path, ended: Ended, megabytes: float) -> None:
    """Add one task to the log of times; where the log cannot be written it is left."""
    path = out / "logs" / KEPT
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        fresh = not path.exists()
        with path.open("a", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            if fresh:
                writer.writerow(COLUMNS)
            writer.writerow([ended.identity, ended.status, f"{ended.seconds:.4f}", f"{megabytes:.4f}"])


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
