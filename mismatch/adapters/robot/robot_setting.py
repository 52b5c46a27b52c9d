"""`Setting`: robot, recordings and tolerance that stay the same while causes are compared."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_model import Numbered, SpatialRobot, changed_robot

from ...models.model_shape import LabError
from .posed_recording import PosedRecording
from .robot_receptance import RobotModes, robot_modes

Real = NDArray[np.float64]

Changes = tuple[Numbered, ...]
"""Changes with their numbers; the companions of a change follow it."""


@dataclass(frozen=True)
class Setting:
    """What stays the same while causes are compared.

    Parameters
    ----------
    robot
        As its file has it.
    rigid_links
        The model in question has its links made rigid.
    recordings
        One or more.
    sensor : (3,), m
        Housing sensor from the tip, in the recordings' axes.
    error
        One standard deviation of what a right robot model's modes are still off.
    counts
        Modes of each recording's band.
    """

    robot: SpatialRobot
    rigid_links: bool
    recordings: tuple[PosedRecording, ...]
    sensor: Real
    error: LabError
    counts: tuple[int, ...]

    def modes(self, changes: Changes) -> list[RobotModes]:
        """Modes in every recording's posture with the changes made."""
        robot, offset = changed_robot(self.robot, changes, rigid_links=self.rigid_links)
        return [
            robot_modes(robot, recording, offset, self.sensor, count)
            for recording, count in zip(self.recordings, self.counts, strict=True)
        ]

    def only(self, chosen: Sequence[int]) -> "Setting":
        """The same with some of the recordings."""
        return replace(
            self,
            recordings=tuple(self.recordings[i] for i in chosen),
            counts=tuple(self.counts[i] for i in chosen),
        )
