"""`SerialChain`: joints in a row, each with its place and axis, and the rigid bodies that they carry."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]

BASE = "base"
"""Name of what does not move, for bodies that stand on it."""

RIGID = (np.inf,) * 6


@dataclass(frozen=True)
class SerialJoint:
    """One joint: where it stands on the body before, what it turns about or slides along, and its compliance.

    The body after it has its origin and axes: ``T(q) = place Rot(axis, q)``, or ``place Trans(q axis)``.

    Parameters
    ----------
    name
        Name of the joint, which is also that of the body after it.
    motion
        ``revolute`` or ``prismatic``.
    place : (4, 4)
        Joint at q = 0 in the axes of the body before it.
    axis : (3,)
        Direction of the joint's axis in its own axes; any length.
    lower, upper : rad or m
        Limits of q.
    stiffness : (6,)
        ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)`` about the joint's axis, N/m and N m/rad; infinite: rigid.

    Raises
    ------
    InputError
        Another motion, an axis without direction, or a place that is no rigid motion.
    """

    name: str
    motion: str
    place: Real
    axis: Real
    lower: float = -np.inf
    upper: float = np.inf
    stiffness: Real = field(default_factory=lambda: np.array(RIGID))

    def __post_init__(self) -> None:
        if self.motion not in ("revolute", "prismatic"):
            raise InputError(f"joint {self.name}: motion {self.motion!r} is none of revolute, prismatic")
        if not (np.all(np.isfinite(self.axis)) and np.linalg.norm(self.axis) > 1e-9):
            raise InputError(
                f"joint {self.name}: axis {np.asarray(self.axis).tolist()} has no direction; give e.g. 0 0 1"
            )
        if not np.allclose(self.place[:3, :3] @ self.place[:3, :3].T, np.eye(3), atol=1e-9):
            raise InputError(f"joint {self.name}: its place does not keep lengths and angles; check its rotation")


@dataclass(frozen=True)
class RigidPart:
    """A rigid part that moves with the body after ``joint``.

    Parameters
    ----------
    name
        Name of the part.
    joint
        Joint behind which it moves, or ``base``.
    mass : kg
        Mass of the part.
    centre : (3,), m
        Centre of mass in the axes of the body.
    inertia : (3, 3), kg m^2
        Inertia about the centre, in the axes of the body.
    """

    name: str
    joint: str
    mass: float
    centre: Real
    inertia: Real


@dataclass(frozen=True)
class SerialChain:
    """A serial robot: what a URDF or a table of Denavit-Hartenberg parameters tells of it.

    Parameters
    ----------
    joints
        From the base to the flange.
    parts
        Rigid parts with mass.
    base : (4, 4)
        Base of the first joint in the axes of the cell, whose z points up.
    flange : (4, 4)
        Flange in the axes of the last body.
    tool : (4, 4)
        Tool tip in the axes of the flange; z along the tool, away from the robot.

    Raises
    ------
    InputError
        No joint, a name twice, or a part on a joint that is not there.
    """

    joints: tuple[SerialJoint, ...]
    parts: tuple[RigidPart, ...] = ()
    base: Real = field(default_factory=lambda: np.eye(4))
    flange: Real = field(default_factory=lambda: np.eye(4))
    tool: Real = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        names = [joint.name for joint in self.joints]
        if not names:
            raise InputError("a serial robot needs at least one joint")
        for name in names:
            if names.count(name) > 1 or name in ("0", BASE):
                raise InputError(f"joint name {name!r} is taken; name each joint once, and none '0' or {BASE!r}")
        for part in self.parts:
            if part.joint != BASE and part.joint not in names:
                raise InputError(f"body {part.name}: there is no joint {part.joint!r}; use {', '.join([BASE, *names])}")
