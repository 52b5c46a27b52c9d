"""How the learned posture model does at poses that were left out, and poses that the others contradict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import false_discovery_control, norm

from millfrf.robot_model import (
    LearnedPostures,
    LeftOutPosture,
    left_out_postures,
    read_learned_postures,
    read_spatial_robot,
    typed_values,
)

Real = NDArray[np.float64]

FALSE_ALARMS = 0.01
"""Expected share of false ones among the poses that are named. Bands are not exact, so it is below that of drifts."""


@dataclass(frozen=True)
class Contradiction:
    """A pose whose frequency lies outside of what the other poses lead one to expect.

    Parameters
    ----------
    pose
        Name of the pose.
    frequency : Hz
        Measured natural frequency of the mode that is farthest off.
    low, high : Hz
        Ends of the 95 % band that the other poses give.
    """

    pose: str
    frequency: float
    low: float
    high: float


@dataclass(frozen=True)
class PostureCoverage:
    """The posture model at poses that were left out in turn.

    Parameters
    ----------
    left_out
        Each measurement beside what the other poses say of its pose; empty below three poses.
    poses
        Name of the pose of each of them.
    contradictions
        Poses that the others contradict.
    middle
        Driven joint values in the middle of the measured poses, as typed (degrees; prismatic joints: m).
    """

    left_out: tuple[LeftOutPosture, ...]
    poses: tuple[str, ...]
    contradictions: tuple[Contradiction, ...]
    middle: tuple[float, ...]

    @property
    def held(self) -> tuple[int, int, int]:
        """Number of modes whose frequency, and whose damping, lies in its band, and number of modes."""
        if not self.left_out:
            return 0, 0, 0
        every = np.vstack([one.held for one in self.left_out])
        return int(every[:, 0].sum()), int(every[:, 1].sum()), len(every)


def coverage_of(robot: str, learned: Path, pose_of: Mapping[str, str]) -> PostureCoverage:
    """Leave each pose out of the posture model in turn.

    Parameters
    ----------
    robot
        Name of a robot that ships, or its file.
    learned
        File of learned postures.
    pose_of
        Name of the pose of each measurement; one that is missing is its own.

    Raises
    ------
    InputError
        A robot or a file that cannot be used.
    """
    case = read_spatial_robot(robot)
    model: LearnedPostures = read_learned_postures(learned, case.robot)
    left_out = left_out_postures(model)
    poses = tuple(pose_of.get(one.name, one.name) for one in left_out)
    middle = typed_values(case.robot.mechanism, np.mean([one.driven for one in model.measured], axis=0))
    return PostureCoverage(left_out, poses, _contradictions(left_out, poses), tuple(float(x) for x in middle))


def _contradictions(left_out: Sequence[LeftOutPosture], poses: Sequence[str]) -> tuple[Contradiction, ...]:
    """Poses whose farthest frequency is more than chance: the largest of several normal deviations."""
    worst: dict[str, tuple[float, Contradiction]] = {}
    for pose in dict.fromkeys(poses):
        own = [one for one, name in zip(left_out, poses, strict=True) if name == pose and len(one.errors)]
        found = [_farthest(pose, one) for one in own]
        if found:
            worst[pose] = sorted(found, key=lambda one: one[0])[len(found) // 2]
    if not worst:
        return ()
    adjusted = false_discovery_control([p_value for p_value, _ in worst.values()])
    return tuple(one for (_, one), value in zip(worst.values(), adjusted, strict=True) if value <= FALSE_ALARMS)


def _farthest(pose: str, one: LeftOutPosture) -> tuple[float, Contradiction]:
    half = np.log(one.high[:, 0] / one.low[:, 0]) / 2
    away = np.abs(one.errors[:, 0]) / (half / norm.isf(0.025))
    k = int(np.argmax(away))
    p_value = min(1.0, 2 * len(away) * float(norm.sf(away[k])))
    band = float(one.low[k, 0]), float(one.high[k, 0])
    return p_value, Contradiction(pose, float(one.measured[k, 0]), *band)
