"""Tables that robot files of all kinds share."""

from collections.abc import Sequence
from math import hypot

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from millfrf.core import InputError

from ..finite_elements.reduction import rayleigh_constants
from ..full_update.changed_structure import UpdateParameter, changed_by
from ..kinematics.joint_values import named_values
from ..kinematics.mechanism import Frame, Mechanism
from ..spatial.spatial_robot import JointDrive, SpatialRobot
from ..uncertain_robot.bands import RobotUncertainty
from .robot_files import Table


class Damping(Table):
    """Either two ratios at two frequencies (Rayleigh), or one ratio for all modes.

    Parameters
    ----------
    frequencies_hz : Hz
        Two frequencies at which the ``ratios`` hold (Rayleigh).
    ratios
        Damping ratios there, 0 to below 1; 4 % is 0.04.
    ratio
        One damping ratio for all modes, instead; 4 % is 0.04.
    """

    frequencies_hz: tuple[float, float] | None = None
    ratios: tuple[float, float] | None = None
    ratio: float | None = Field(None, ge=0, lt=1)


class Pose(Table):
    """A posture: ``driven`` in degrees, of prismatic joints in metres; ``driven_deg`` is its older name.

    Parameters
    ----------
    name
        Name of the posture.
    driven : deg; prismatic joints m
        Values of the driven joints in the order of the frames.
    driven_deg : deg; prismatic joints m
        Older name of ``driven``: prismatic joints are in metres here too.
    """

    name: str
    driven: list[float] | None = None
    driven_deg: list[float] | None = None


def named_postures(poses: Sequence[Pose], mechanism: Mechanism) -> dict[str, NDArray[np.float64]]:
    """Postures of a file by name, rad and m."""
    typed = []
    for pose in poses:
        given = [values for values in (pose.driven, pose.driven_deg) if values is not None]
        if len(given) != 1:
            raise InputError(f"posture {pose.name!r}: give driven = [...] once: degrees, prismatic joints in metres")
        typed.append((pose.name, given[0]))
    return named_values(mechanism, typed)


def rayleigh_of(damping: Damping | None) -> tuple[float, float]:
    """Rayleigh's constants of a file's damping, 1/s and s; zero where it gives one ratio."""
    if damping is None:
        return (0.0, 0.0)
    if damping.ratio is not None:
        if damping.ratios is not None or damping.frequencies_hz is not None:
            raise InputError("damping: give one ratio, or frequencies_hz and ratios (two each), not both")
        return (0.0, 0.0)
    if damping.frequencies_hz is None or damping.ratios is None:
        raise InputError("damping: give frequencies_hz and ratios (two each), or one ratio")
    if not all(0 <= ratio < 1 for ratio in damping.ratios):
        raise InputError(f"damping: ratios = {list(damping.ratios)} must be 0 or more and below 1; 4 % is 0.04")
    return rayleigh_constants(damping.frequencies_hz, damping.ratios)


def upwards(given: tuple[float, float, float]) -> tuple[float, float, float]:
    """Unit vector against weight."""
    length = hypot(*given)
    if not length > 0:
        raise InputError(f"up = {list(given)} has no direction; give the base frame's axis against weight: [0, 0, 1]")
    return given[0] / length, given[1] / length, given[2] / length


class DriveKeys(Table):
    """Optional keys of a ``[[joints]]`` table: the first two and one gain, or none of them.

    Parameters
    ----------
    motor_inertia_kg_m2 : kg m^2
        Inertia of what turns with the motor.
    gear_ratio
        Turns of the motor over those of the joint; rad/m for a prismatic joint.
    position_gain_nm_per_rad : N m/rad
        Static stiffness with which the controller holds the motor of a revolute joint, on the side of the joint.
    position_gain_n_per_m : N/m
        The same for a prismatic joint.
    """

    motor_inertia_kg_m2: float | None = Field(None, gt=0, le=1)
    gear_ratio: float | None = Field(None, ge=1)
    position_gain_nm_per_rad: float | None = Field(None, gt=0)
    position_gain_n_per_m: float | None = Field(None, gt=0)


def drive_of(row: DriveKeys, frame: Frame | None) -> JointDrive | None:
    """The drive of a joint, or None where its table tells none.

    Parameters
    ----------
    row
        Table of the joint.
    frame
        Frame of the joint; None: a frame that the file does not have, which is refused elsewhere.

    Raises
    ------
    InputError
        A part of the keys, the gain of the other motion, or the drive of a joint that is not driven.
    """
    gains = {"revolute": row.position_gain_nm_per_rad, "prismatic": row.position_gain_n_per_m}
    given = [row.motor_inertia_kg_m2, row.gear_ratio, *gains.values()]
    if frame is None or all(value is None for value in given):
        return None
    if frame.motion == "fixed" or not frame.active:
        raise InputError(f"joint {frame.name} is not driven: leave motor_inertia_kg_m2, gear_ratio and its gain out")
    gain = gains.pop(frame.motion)
    keys = {"revolute": "position_gain_nm_per_rad", "prismatic": "position_gain_n_per_m"}
    if row.motor_inertia_kg_m2 is None or row.gear_ratio is None or gain is None or any(gains.values()):
        raise InputError(
            f"joint {frame.name}: a drive is motor_inertia_kg_m2, gear_ratio and, for a {frame.motion} joint, "
            f"{keys[frame.motion]}: give these three, or none (a motor that is held moves nothing)"
        )
    return JointDrive(row.motor_inertia_kg_m2, row.gear_ratio, gain)


class Number(Table):
    """A number that was freed; one that is not ``in_file`` has no key of its own there and is applied on reading.

    Parameters
    ----------
    name
        Name of the number.
    kind
        What it is: ``stiffness``, ``joint damping``, ``damping``, ``links``, ``inertia``, ``body``, ``payload``,
        ``tool mass``, ``sprung mass``, ``tool`` or ``base``.
    unit
        Unit of spread, value and standard error; empty: they are natural logarithms of a factor on the file's number
        (stiffness, links, damping, inertia), or ratios.
    frame
        Joint of a stiffness or of a joint's damping.
    group
        Directions of that joint, such as its gear or its bearing; empty for the others.
    axis
        Direction of a payload's place, 0 to 2, and 3 for its mass; of a tool or base 0 or 1.
    spread
        Standard deviation of the belief before the measurements, in ``unit``.
    value
        Change that was found, in ``unit``; where this is empty, 0.1 is a factor of 1.105.
    standard_error
        Standard error of ``value``, in ``unit``.
    told
        Whether the measurements tell it.
    in_file
        Whether the file has a key of its own for it.
    """

    name: str
    kind: str
    unit: str = ""
    frame: str = ""
    group: str = ""
    axis: int = 0
    spread: float
    value: float
    standard_error: float = 0.0
    told: bool = True
    in_file: bool = True


class UpdateTable(Table):
    """Verdict, names, numbers and their covariance.

    Parameters
    ----------
    verdict
        Verdict of the update.
    named
        Numbers that are surely wrong in the file before.
    covariance
        Covariance of the numbers, row by row.
    numbers
        Numbers that were freed, ``[[update.numbers]]``.
    """

    verdict: str
    named: list[str]
    covariance: list[list[float]]
    numbers: list[Number]


def uncertainty_of(table: UpdateTable) -> RobotUncertainty:
    """Numbers and covariance of an ``[update]`` table.

    Raises
    ------
    InputError
        A covariance of another size, or none.
    """
    values = np.array([row.value for row in table.numbers])
    return RobotUncertainty(_parameters(table.numbers), values, np.array(table.covariance, ndmin=2))


def left_open(table: UpdateTable) -> tuple[str, ...]:
    """A sentence for joint stiffnesses that the measurements of an update did not tell; empty where there are none."""
    rows = [row.name.removesuffix(" stiffness") for row in table.numbers if row.kind == "stiffness" and not row.told]
    if not rows:
        return ()
    return (
        f"the update's measurements do not tell the stiffness of {', '.join(dict.fromkeys(rows))}: it is the file's "
        "own, and only as good as that",
    )


def with_late_numbers(robot: SpatialRobot, table: UpdateTable) -> SpatialRobot:
    """The robot with the numbers that its file has no key for: a payload, a tool, a base that gives way."""
    late = [row for row in table.numbers if not row.in_file]
    values: NDArray[np.float64] = np.array([row.value for row in late])
    return changed_by(robot, _parameters(late), values) if late else robot


def _parameters(rows: list[Number]) -> tuple[UpdateParameter, ...]:
    return tuple(UpdateParameter(r.name, r.kind, r.unit, r.spread, r.frame, r.group, r.axis) for r in rows)
