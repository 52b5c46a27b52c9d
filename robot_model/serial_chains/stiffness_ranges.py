"""Typical joint stiffness by payload: orders of magnitude to start from, never a measurement."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from foundation import InputError

from .serial_chain import SerialJoint

RAIL_STIFFNESS = (2e7, 2e8)
"""Rack-and-pinion or ball-screw drive of a linear axis, N/m."""


@dataclass(frozen=True)
class StiffnessClass:
    """Ranges for one class of robots.

    Parameters
    ----------
    payload : kg
        Largest payload of the class.
    arm : N m/rad
        Range of the first three revolute joints.
    wrist : N m/rad
        Range of the others.
    basis
        Where the range comes from.
    """

    payload: float
    arm: tuple[float, float]
    wrist: tuple[float, float]
    basis: str


CLASSES = (
    StiffnessClass(
        20.0, (1e4, 1e5), (3e3, 3e4), "strain-wave gears of sizes 14 to 32, torsional stiffness in catalogues"
    ),
    StiffnessClass(60.0, (1e5, 1e6), (2e4, 2e5), "between the two classes beside it; cycloidal gears"),
    StiffnessClass(300.0, (1e6, 5e6), (2e5, 1e6), "order identified on robots of 200 to 300 kg (Dumas et al. 2011)"),
    StiffnessClass(np.inf, (3e6, 2e7), (5e5, 5e6), "order of heavy robots of 500 kg and more (Jubien et al. 2014)"),
)


def class_of(payload: float) -> StiffnessClass:
    """Class of a rated payload, kg.

    Raises
    ------
    InputError
        A payload that is not positive.

    Examples
    --------
    >>> class_of(10.0).payload
    20.0
    """
    if not payload > 0:
        raise InputError(f"--rated-payload {payload:g}: give the robot's rated payload in kg")
    return next(entry for entry in CLASSES if payload <= entry.payload)


def typical(joints: Sequence[SerialJoint], entry: StiffnessClass) -> list[tuple[float, tuple[float, float]]]:
    """Middle (geometric mean) and range for each joint, N m/rad; N/m of prismatic joints."""
    found, turned = [], 0
    for joint in joints:
        span = RAIL_STIFFNESS
        if joint.motion == "revolute":
            span = entry.arm if turned < 3 else entry.wrist
            turned += 1
        found.append((float(np.sqrt(span[0] * span[1])), span))
    return found
