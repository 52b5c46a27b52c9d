"""`MeasuredSet`: what the jobs of a campaign made of the recordings that belong together."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

POSE, POSTURE = "pose", "posture_deg"
"""Labels with a meaning of their own: the name of the pose, and its joint angles."""

NOT_STATED = "not stated"
"""Pose of sets that state neither pose nor posture: they are taken to be in one."""


@dataclass(frozen=True)
class MeasuredSet:
    """Recordings that were stacked to one FRF, and where their results are.

    Parameters
    ----------
    name
        Name of the set, such as ``P07 session=2``; no two sets of a campaign share one.
    labels
        Labels that its recordings share, text or numbers; a number that differs among them stands as its mean.
    posture : (n_active,), rad or m
        Driven joint values, or None where the posture is not known.
    recorded_at : s
        Mean time of its recordings since 1970, or None.
    recordings
        Names of the recordings' files.
    model
        Modal model at the tool tip, JSON; None: there is none.
    lobes
        Lobes of that model, CSV; None: there are none.
    diagnosis
        Diagnosis of the set, JSON; None: there is none.
    failures
        One line for each step that failed.
    """

    name: str
    labels: Mapping[str, str | float]
    posture: tuple[float, ...] | None
    recorded_at: float | None
    recordings: tuple[str, ...]
    model: Path | None
    lobes: Path | None
    diagnosis: Path | None
    failures: tuple[str, ...]

    @property
    def pose(self) -> str:
        """Name of the pose; of a set without that label its joint values, or ``NOT_STATED``."""
        named = self.labels.get(POSE)
        if named is not None:
            return str(named)
        if self.posture is not None:
            return "(" + ", ".join(f"{value:.4g}" for value in self.posture) + ")"
        return NOT_STATED
