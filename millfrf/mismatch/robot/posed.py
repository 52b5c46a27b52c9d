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

ROBOT = Settings(
    lab=LabError(frequency=0.01, damping=0.15, shape=0.05),
    evidence=EvidenceSettings(as_good=6.0),
    search=SearchSettings(most_causes=2, most_tested=4),
    proof=ProofSettings(significance=0.01, beaten=0.25),
    verdict=VerdictSettings(noise_like=2.0, explained=0.9, partly=0.5),
)
"""Thresholds of the core that differ for robots.

The modes of a right robot model are off by one per cent, 15 per cent, and a twentieth of a shape's size: choices of
this project, no published figures. Equivalents are within a likelihood ratio of 20. What is left is measured by the
cost for each deviation that the recordings tell: 1 is expected of a right model, up to 2 passes for noise.
"""


@dataclass(frozen=True)
class RobotLimits(Thresholds):
    """Thresholds that only a robot's comparison has.

    Parameters
    ----------
    reach
        Modes up to so many times the band's upper end may deviate: those above the band lend it their flexibility.
    strange
        Deviation, in standard deviations, above which a mode that the recordings show is not taken for one of the
        robot's: 60 are a factor of 1.8 in frequency, more than any change shifts a mode.
    loose
        Precision of the belief under which modes are fitted freely: ten standard deviations then count as one.
    block
        Length of a block of time in the test of held-out errors, s: several time constants of a robot's modes.
    least_blocks
        Blocks below which no signed rank is significant: 7 falls in a row have p = 2^-7 = 0.008 (Wilcoxon 1945).
    """

    reach: float = 3.0
    strange: float = 60.0
    loose: float = 0.01
    block: float = 1.0
    least_blocks: int = 7


LIMITS = RobotLimits()
"""The values that are used."""

Changes = tuple[Numbered, ...]
"""Changes with their numbers; the companions of a change follow it."""


@dataclass(frozen=True)
class PosedRobot:
    """A robot in the postures of its recordings.

    Parameters
    ----------
    robot
        The robot as its file has it.
    rigid_links
        Whether the model in question has its links made rigid.
    recordings
        One or more recordings with their postures.
    sensor : (3,), m
        Place of the housing sensor from the tip, in the recordings' axes.
    error
        One standard deviation of what the modes of a right robot model are still off.
    counts
        Number of modes that may deviate, for each recording.
    """

    robot: SpatialRobot
    rigid_links: bool
    recordings: tuple[PosedRecording, ...]
    sensor: Real
    error: LabError
    counts: tuple[int, ...]

    @property
    def values(self) -> int:
        """Number of real values that are compared: the N of Bayes' information criterion."""
        return 2 * sum(one.spectrum.measured.size for one in self.recordings)

    @property
    def several_postures(self) -> bool:
        """Whether the recordings were made in more than one posture."""
        return any(not np.allclose(one.q, self.recordings[0].q) for one in self.recordings)

    def modes(self, changes: Changes) -> list[RobotModes]:
        """Modes in every recording's posture, with the changes made.

        Parameters
        ----------
        changes
            Changes and their numbers.
        """
        robot, offset = changed_robot(self.robot, changes, rigid_links=self.rigid_links)
        return [
            robot_modes(robot, recording, offset, self.sensor, count)
            for recording, count in zip(self.recordings, self.counts, strict=True)
        ]

    def only(self, chosen: Sequence[int]) -> "PosedRobot":
        """The same robot with some of the recordings.

        Parameters
        ----------
        chosen
            Numbers of the recordings, from 0.
        """
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
    """Put a robot in the postures of its recordings, and count the modes that matter in each band.

    Parameters
    ----------
    robot
        The robot as its file has it.
    recordings
        One or more recordings with their postures.
    error
        One standard deviation of what the modes of a right robot model are still off.
    rigid_links
        Whether the model in question has its links made rigid.
    sensor : (3,), m
        Place of the housing sensor from the tip, in the recordings' axes; None where no motion of the housing was
        recorded.

    Raises
    ------
    InputError
        No recording, a housing sensor without its place, or a band without modes.
    """
    if not recordings:
        raise InputError("no recording given; name one or more, each with its posture")
    if sensor is None and any(label.startswith("HOUSING") for one in recordings for label in one.responses):
        raise InputError(
            "motion of the housing was recorded; say where the sensor is: "
            "sensor = (x, y, z) in m from the tip (--sensor X Y Z)"
        )
    counts = []
    for one in recordings:
        natural = modes_at(robot, one.q).frequencies
        counts.append(int(np.sum(natural < LIMITS.reach * one.spectrum.frequencies[-1])))
        if not counts[-1]:
            raise InputError(
                f"{one.name}: the robot's lowest mode, {natural[0]:.4g} Hz, is above the band; raise the band"
            )
    place = np.zeros(3) if sensor is None else np.asarray(sensor, dtype=float)
    found = PosedRobot(robot, rigid_links, tuple(recordings), place, error, tuple(counts))
    if not rigid_links:
        return found
    fewer = [min(count, len(modes.natural)) for count, modes in zip(counts, found.modes(()), strict=True)]
    return replace(found, counts=tuple(fewer))
