"""`PosedRobot`: a robot in the postures of its recordings; settings of the comparison."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.robot_model import Numbered, SpatialRobot, changed_robot, modes_at

from ..inference.settings import (
    EvidenceSettings,
    LabError,
    ProofSettings,
    SearchSettings,
    Settings,
    Thresholds,
    VerdictSettings,
)
from .receptance import PosedRecording, RobotModes, robot_modes

# Thresholds that differ for robots. The modes of a right robot model have errors of 1 % in frequency, 15 % in damping
# and 5 % in shape: choices of this project, not published figures. Equivalents lie within a likelihood ratio of 20.
# The residual is measured by the excess cost per deviation that the recordings determine: 1 is expected of a correct
# model, and up to 2 passes for noise.
ROBOT = Settings(
    lab=LabError(frequency=0.01, damping=0.15, shape=0.05),
    evidence=EvidenceSettings(as_good=6.0),
    search=SearchSettings(most_causes=2, most_tested=4),
    proof=ProofSettings(significance=0.01, beaten=0.25),
    verdict=VerdictSettings(noise_like=2.0, explained=0.9, partly=0.5),
)


@dataclass(frozen=True)
class RobotLimits(Thresholds):
    """Thresholds of robots only.

    Parameters
    ----------
    reach
        Modes up to this multiple of the upper end of the band may deviate, as modes above the band add flexibility.
    strange
        Deviation, in standard deviations, above which a measured mode is not assigned to a mode of the robot: 60 are a
        factor of 1.8 in frequency, more than any change causes.
    loose
        Precision of the prior in the free fit of modes: 0.01 allows ten times larger deviations.
    block
        Length of a block of time in the test of held-out errors, s: several time constants of a robot's modes.
    least_blocks
        Number of blocks below which no signed rank test is significant: if the error falls in all of 7 blocks, p is
        2^-7 = 0.008 (Wilcoxon 1945).
    """

    reach: float = 3.0
    strange: float = 60.0
    loose: float = 0.01
    block: float = 1.0
    least_blocks: int = 7


LIMITS = RobotLimits()

Changes = tuple[Numbered, ...]  # changes with their numbers; companions follow their change


@dataclass(frozen=True)
class PosedRobot:
    """A robot in the postures of its recordings."""

    robot: SpatialRobot
    rigid_links: bool  # whether the links of the model are rigid
    recordings: tuple[PosedRecording, ...]
    sensor: Real  # place of the housing sensor from the tip, in the recordings' axes, (3,), m
    error: LabError
    counts: tuple[int, ...]  # number of modes that may deviate, for each recording

    @property
    def values(self) -> int:
        """Number of compared real values: the N of Bayes' information criterion."""
        return 2 * sum(recording.spectrum.measured.size for recording in self.recordings)

    @property
    def several_postures(self) -> bool:
        """Whether the recordings were made in more than one posture."""
        return any(not np.allclose(recording.q, self.recordings[0].q) for recording in self.recordings)

    def modes(self, changes: Changes) -> list[RobotModes]:
        """Return the modes with the changes, in the posture of each recording."""
        robot, offset = changed_robot(self.robot, changes, rigid_links=self.rigid_links)
        return [
            robot_modes(robot, recording, offset, self.sensor, count)
            for recording, count in zip(self.recordings, self.counts, strict=True)
        ]

    def only(self, chosen: Sequence[int]) -> "PosedRobot":
        """Return the robot with only the recordings of the indices ``chosen``."""
        recordings = tuple(self.recordings[i] for i in chosen)
        return replace(self, recordings=recordings, counts=tuple(self.counts[i] for i in chosen))


def posed_robot(
    robot: SpatialRobot,
    recordings: Sequence[PosedRecording],
    error: LabError,
    *,
    rigid_links: bool = False,
    sensor: Real | None = None,
) -> PosedRobot:
    """Put a robot in the postures of its recordings, and count the modes in each band.

    ``sensor``: place of the housing sensor from the tip, in the axes of the recordings; None if no motion of the
    housing was recorded, (3,), m.
    """
    if not recordings:
        raise InputError("no recording given; name one or more, each with its posture")
    if sensor is None and any(label.startswith("HOUSING") for recording in recordings for label in recording.responses):
        raise InputError(
            "motion of the housing was recorded; say where the sensor is: "
            "sensor = (x, y, z) in m from the tip (--sensor X Y Z)"
        )
    counts = []
    for recording in recordings:
        natural = modes_at(robot, recording.q).frequencies
        counts.append(int(np.sum(natural < LIMITS.reach * recording.spectrum.frequencies[-1])))
        if not counts[-1]:
            raise InputError(
                f"{recording.name}: the robot's lowest mode, {natural[0]:.4g} Hz, is above the band; raise the band"
            )
    place = np.zeros(3) if sensor is None else np.asarray(sensor, dtype=float)
    posed = PosedRobot(robot, rigid_links, tuple(recordings), place, error, tuple(counts))
    if not rigid_links:
        return posed
    fewer = [min(count, len(modes.natural)) for count, modes in zip(counts, posed.modes(()), strict=True)]
    return replace(posed, counts=tuple(fewer))
