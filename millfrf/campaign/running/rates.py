"""How long tasks take: measured by earlier runs of the campaign, else stated defaults."""

import csv
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..graph import Task
from .one_task import DONE, Ended

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
