"""Progress of a run, and the expected time of its tasks."""

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

# seconds per task and per megabyte of recordings on one core, measured: see docs/campaigns.md
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


@dataclass(frozen=True)
class Rates:
    """Expected times by kind of task."""

    each: Mapping[str, float]  # s per task
    megabyte: Mapping[str, float]  # s per megabyte of input
    measured: frozenset[str]  # kinds whose rates come from earlier runs of this campaign

    def seconds(self, task: Task, megabytes: float) -> float:
        """Return the expected time of a task, s."""
        return self.each[task.kind] + self.megabyte[task.kind] * megabytes


def measured_rates(out: Path) -> Rates:
    """Compute rates from the log of earlier runs, with defaults for kinds that are not in the log.

    Both default rates of a kind are multiplied by the same factor, so that the expected time of its finished tasks
    equals their measured time.
    """
    measured: dict[str, float] = {}
    expected: dict[str, float] = {}
    with suppress(OSError, ValueError, KeyError), (out / "logs" / KEPT).open(newline="", encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            kind = row["task"].partition(":")[0]
            if row["status"] == DONE and kind in DEFAULTS:
                per_task, per_megabyte = DEFAULTS[kind]
                measured[kind] = measured.get(kind, 0.0) + float(row["seconds"])
                expected[kind] = expected.get(kind, 0.0) + per_task + per_megabyte * float(row["megabytes"])
    scale = {
        kind: measured[kind] / expected[kind] if expected.get(kind) else 1.0 for kind in DEFAULTS if kind in measured
    }
    return Rates(
        {kind: per_task * scale.get(kind, 1.0) for kind, (per_task, _) in DEFAULTS.items()},
        {kind: per_megabyte * scale.get(kind, 1.0) for kind, (_, per_megabyte) in DEFAULTS.items()},
        frozenset(scale),
    )


def note_time(out: Path, ended: Ended, megabytes: float) -> None:
    """Append one task to the log of times; ignore errors of writing."""
    path = out / "logs" / KEPT
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        is_new = not path.exists()
        with path.open("a", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            if is_new:
                writer.writerow(COLUMNS)
            writer.writerow([ended.identity, ended.status, f"{ended.seconds:.4f}", f"{megabytes:.4f}"])


LINE_INTERVAL = 20.0  # s between two lines in a log file
REDRAW_INTERVAL = 0.2  # s between two updates in a terminal


@dataclass
class ProgressLines:
    """Counter of finished tasks that shows their number, their rate and the expected remaining time."""

    expected: Mapping[str, float]  # s; time that each task is believed to take, by its identity
    # kinds measured in earlier runs; the time of other kinds is unknown until one task has ended
    measured: Collection[str] = ()
    done: int = 0
    refused: int = 0
    failed: int = 0
    _left: dict[str, float] = field(default_factory=dict)
    _number: dict[str, float] = field(default_factory=dict)
    _expected_done: dict[str, float] = field(default_factory=dict)
    _measured_done: dict[str, float] = field(default_factory=dict)
    _started: float = field(default_factory=time.monotonic)
    _last_shown: float = field(default_factory=time.monotonic)
    _bar: Any = None

    def __post_init__(self) -> None:
        for identity, seconds in self.expected.items():
            _add(self._left, identity, seconds)
            _add(self._number, identity, 1)

    def ended(self, ended: Ended) -> None:
        """Count one finished task."""
        self.done += 1
        self.refused += ended.status == REFUSED
        self.failed += ended.status not in (DONE, REFUSED)
        _add(self._left, ended.identity, -self.expected[ended.identity])
        _add(self._number, ended.identity, -1)
        if ended.status == DONE:
            _add(self._expected_done, ended.identity, self.expected[ended.identity])
            _add(self._measured_done, ended.identity, ended.seconds)

    def line(self, workers: int) -> str:
        """Return the state of the run in one line."""
        elapsed = max(time.monotonic() - self._started, 1e-3)
        text = f"{self.done} of {len(self.expected)} tasks, {self.done / elapsed:.2g}/s, {self.refused} refused"
        if self.failed:
            text += f", {self.failed} failed"
        if not workers:
            text += ", no worker is connected; waiting"
        elif 0 < self.done < len(self.expected):
            text += f", {self._time_left(workers)}"
        return text

    def _time_left(self, workers: int) -> str:
        """Describe the remaining time of the kinds of tasks with measured times, and name the kinds without."""
        paces = dict.fromkeys(self.measured, 1.0)
        paces |= {
            kind: self._measured_done[kind] / expected for kind, expected in self._expected_done.items() if expected > 0
        }
        open_kinds = [kind for kind, number in self._number.items() if number > 0 and kind not in paces]
        seconds = sum(max(left, 0.0) * paces[kind] for kind, left in self._left.items() if kind in paces)
        unknown = f"time of {', '.join(open_kinds)} not known yet"
        if not open_kinds:
            return f"about {shown_time(seconds / workers)} left"
        if not any(number > 0 for kind, number in self._number.items() if kind in paces):
            return unknown
        return f"about {shown_time(seconds / workers)} left without these; {unknown}"

    def show(self, workers: int) -> None:
        """Show the state of the run, unless it was shown a moment ago."""
        now = time.monotonic()
        if now - self._last_shown < (REDRAW_INTERVAL if sys.stderr.isatty() else LINE_INTERVAL):
            return
        self._last_shown = now
        if sys.stderr.isatty():
            self._draw(workers)
        else:
            sys.stderr.write(f"{printable(self.line(workers))}\n")
            sys.stderr.flush()

    def _draw(self, workers: int) -> None:
        if self._bar is None:
            self._bar = progress_bar()
            self._bar.start()
            self._bar.add_task("campaign", total=len(self.expected))
        self._bar.update(0, completed=self.done, description=self.line(workers))

    def stop(self) -> None:
        """Remove the progress bar."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _add(sums: dict[str, float], identity: str, seconds: float) -> None:
    kind = identity.partition(":")[0]
    sums[kind] = sums.get(kind, 0.0) + seconds


def shown_time(seconds: float) -> str:
    """Format a time with a suitable unit.

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
