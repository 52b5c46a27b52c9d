"""`PosedRobot`: a robot in the postures of its recordings; it stays the same while causes are compared."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError
from robot_model import Numbered, SpatialRobot, changed_robot, modes_at

from ...inference import LabError
from .posed_recording import PosedRecording
from .receptance import RobotModes, robot_modes
from .settings import LIMITS

Real = NDArray[np.float64]

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
