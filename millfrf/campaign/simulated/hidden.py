"""What a simulated campaign hides: a joint that softens from session to session in one pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.robot_model import modes_at

from .schedule import PlannedRecording
from .true_robot import Condition, TrueRobot, energy_shares

Real = NDArray[np.float64]

SOFTENING = 0.035
"""Share of a joint's stiffness that is lost from the first session to the last."""

LOW_MODES = 6
"""Modes that the recordings show."""


@dataclass(frozen=True)
class HiddenDrift:
    """A joint that softens where the robot stands in one pose: a worn place of its gear.

    Parameters
    ----------
    pose
        Number of the pose, from 0.
    joint
        Frame of the joint.
    factors : (n_sessions,)
        Factor on the joint's stiffness in each session.
    """

    pose: int
    joint: str
    factors: tuple[float, ...]

    def condition(self, planned: PlannedRecording) -> Condition:
        """The robot's state in a recording."""
        softer = {self.joint: self.factors[planned.session - 1]} if planned.pose == self.pose else {}
        return Condition(planned.temperature, softer)


def drawn_drift(true: TrueRobot, postures: Real, sessions: int, generator: np.random.Generator) -> HiddenDrift:
    """Draw the pose, and take the joint that holds most of the energy of one of its low modes."""
    pose = int(generator.integers(len(postures)))
    shares = energy_shares(true.robot, modes_at(true.robot, postures[pose]))[:LOW_MODES, :-1]
    joint = true.driven_joints()[int(np.argmax(shares.max(axis=0)))].frame
    lost = SOFTENING * np.arange(sessions) / (sessions - 1)
    return HiddenDrift(pose, joint, tuple(float(value) for value in 1 - lost))
