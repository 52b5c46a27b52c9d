"""`SerialChain`: joints in a row with their places and axes, and the bodies that they carry."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..kinematics.mechanism import Frame

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


_SMALLEST, _LARGEST = 1e-12, 1e5
"""Sizes of the largest entry of an inertia, kg m^2."""


def place_of(shift: Sequence[float], angles: Sequence[float]) -> Real:
    """Shift (3,), m, and turns about the fixed axes x, y and z in turn (roll, pitch, yaw as in URDF), rad; (4, 4).

    Examples
    --------
    >>> place_of((0.0, 0.0, 1.0), (np.pi / 2, 0.0, 0.0))[:3, 2].round(12).tolist()
    [0.0, -1.0, 0.0]
    """
    place = np.eye(4)
    place[:3, :3] = scipy.spatial.transform.Rotation.from_euler("xyz", angles).as_matrix()
    place[:3, 3] = shift
    return place


def shift_and_angles(place: Real) -> tuple[list[float], list[float]]:
    """The way back: shift, m, and roll, pitch, yaw, rad."""
    rotation = place[:3, :3]
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if np.hypot(rotation[0, 0], rotation[1, 0]) > 1e-12:
        roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    else:  # pitch +-90 degrees: roll and yaw turn about one axis
        roll, yaw = 0.0, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    return [float(value) for value in place[:3, 3]], [roll, pitch, yaw]


def symmetric(six: Sequence[float]) -> Real:
    """``(xx, yy, zz, xy, xz, yz)``, or three on the diagonal, as a symmetric matrix (3, 3)."""
    xx, yy, zz, xy, xz, yz = (*six, 0.0, 0.0, 0.0) if len(six) == 3 else six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def six_of(matrix: Real) -> list[float]:
    """``(xx, yy, zz, xy, xz, yz)`` of a symmetric matrix (3, 3)."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [float(matrix[i, j] + matrix[j, i]) / 2 for i, j in pairs]


def inertia_fault(inertia: Real, tolerance: float = 1e-3) -> str | None:
    """Why no body can have this inertia (3, 3), kg m^2, about its centre; or None.

    Principal moments are not negative, and none is larger than the other two together. ``tolerance`` is the share of
    the largest that rounding may take.
    """
    if not np.allclose(inertia, inertia.T, rtol=0, atol=1e-9 * max(float(np.abs(inertia).max()), 1e-300)):
        return "it is not symmetric"
    largest = float(np.abs(inertia).max())
    if largest > _LARGEST or 0 < largest < _SMALLEST:
        return f"its largest entry is {largest:.3g}; give kg m^2 (size {_SMALLEST:g} to {_LARGEST:g})"
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] < -tolerance * max(abs(moments[2]), 1e-12):
        return f"a principal moment is negative: {moments[0]:.4g} kg m^2"
    if moments[2] > moments[0] + moments[1] + tolerance * moments[2] and moments[0] > tolerance * moments[2]:
        return (
            f"principal moments {moments[0]:.4g}, {moments[1]:.4g}, {moments[2]:.4g} kg m^2: no body has one that is "
            "larger than the other two together; check units and axes"
        )
    return None


BASE_FRAME = "base (fixed)"
"""Name of the frame on which the first joint turns."""

_PARALLEL = 1e-12
"""|sin alpha| below which two axes are parallel."""

_STEEP = 1e-3
"""|sin alpha| above which one frame holds a place without loss of digits; between the two, two frames do."""


@dataclass(frozen=True)
class AxisFrames:
    """Frames of a chain, and where each joint's body lies in the frame of its joint.

    Parameters
    ----------
    frames
        Frames from the base on; moving ones have the names of their joints.
    bodies : {joint: (4, 4)}
        Axes of the body after each joint in the joint's frame, and under ``"0"`` those of the base.
    """

    frames: tuple[Frame, ...]
    bodies: dict[str, Real]


def axis_frames(joints: Sequence[SerialJoint], base: Real) -> AxisFrames:
    """Build frames whose z axes are the joints' axes, and as few of them as possible.

    ``T = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)`` holds any place unless two
    axes are nearly, but not quite, parallel. gamma and b turn and shift the frame before about its own axis, so that
    they go into its theta and r: modified Denavit-Hartenberg frames remain (Khalil & Kleinfinger 1986, section 3). A
    joint that gives way across its axis keeps its origin, at which its springs stand.

    Parameters
    ----------
    joints
        Joints from the base on.
    base : (4, 4)
        Base of the first joint in the base frame.
    """
    frames: list[Frame] = []
    bodies: dict[str, Real] = {"0": np.eye(4)}
    inside: Real = np.asarray(base, dtype=float)  # inside: axes of the body before, in the frame before
    before, movable = "0", False
    for joint in joints:
        upright = turn_onto(joint.axis)
        target = np.asarray(inside @ joint.place @ upright)
        if not frames:  # what lies before the first joint stands apart from it, wherever the robot is bolted
            frames += fixed_frames(BASE_FRAME, "0", target)
            before, target = BASE_FRAME, np.eye(4)
        placement, frame = _placed(joint.name, before, target)
        if movable and not placement:
            slide = _about_own_axis(frame.gamma, frame.b)
            frames[-1] = replace(frames[-1], theta=frames[-1].theta + frame.gamma, r=frames[-1].r + frame.b)
            bodies[before] = np.asarray(np.linalg.inv(slide) @ bodies[before])
            frame = replace(frame, gamma=0.0, b=0.0)
        frames += [*placement, replace(frame, motion=joint.motion, lower=joint.lower, upper=joint.upper)]
        bodies[joint.name] = np.asarray(np.linalg.inv(upright))
        before, inside = joint.name, bodies[joint.name]
        movable = bool(np.isinf(joint.stiffness[[0, 1, 3, 4]]).all())
    return AxisFrames(tuple(frames), bodies)


def fixed_frames(name: str, before: str, target: Real) -> tuple[Frame, ...]:
    """One or two fixed frames that hold ``target`` (4, 4) in the frame ``before``; the last has the name."""
    placement, frame = _placed(name, before, target)
    return (*placement, replace(frame, motion="fixed"))


def turn_onto(axis: Real) -> Real:
    """The smallest rotation, as (4, 4), that takes z to ``axis`` (3,).

    Examples
    --------
    >>> turn_onto(np.array([0.0, 1.0, 0.0]))[:3, 2].round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    turned = np.eye(4)
    if x == y == 0:
        turned[:3, :3] = np.diag([1.0, np.sign(z), np.sign(z)])
        return turned
    third = np.array([x, y, z])
    first = np.cross([0.0, 1.0, 0.0] if abs(y) < 0.9 else [0.0, 0.0, 1.0], third)
    first /= np.linalg.norm(first)
    turned[:3, :3] = np.array([first, np.cross(third, first), third]).T
    return turned


def _placed(name: str, before: str, target: Real) -> tuple[list[Frame], Frame]:
    """A frame that holds a place; where that would lose digits, a fixed frame for the shift before it."""
    rotation, shift = target[:3, :3], target[:3, 3]
    sine, cosine = float(np.hypot(rotation[0, 2], rotation[1, 2])), float(rotation[2, 2])
    if sine <= _PARALLEL:
        sign = 1.0 if cosine > 0 else -1.0
        distance = float(np.hypot(shift[0], shift[1]))
        gamma = float(np.arctan2(shift[1], shift[0])) if distance > _PARALLEL else 0.0
        # Rot(z, gamma) Rot(x, 0 or pi) Rot(z, theta): its first column is (cos(gamma +- theta), sin(...), 0)
        whole = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        alpha = 0.0 if sign > 0 else np.pi
        return [], Frame(
            name,
            before,
            gamma=gamma,
            b=float(shift[2]),
            alpha=alpha,
            d=distance,
            theta=_wrapped(sign * (whole - gamma)),
        )
    gamma = float(np.arctan2(rotation[0, 2], -rotation[1, 2]))
    if abs(gamma) > np.pi / 2 + 1e-12:  # the other sign of alpha, so that the frame before is turned little
        gamma, sine = gamma - np.copysign(np.pi, gamma), -sine
    alpha = float(np.arctan2(sine, cosine))
    turned = rotation.T @ np.array([np.cos(gamma), np.sin(gamma), 0.0])
    theta = float(np.arctan2(-turned[1], turned[0]))
    if abs(sine) < _STEEP:
        toward = float(np.arctan2(shift[1], shift[0]))
        away = float(np.hypot(shift[0], shift[1]))
        moved = Frame(f"{name} (place)", before, "fixed", True, toward, float(shift[2]), 0.0, away, -toward, 0.0)
        return [moved], Frame(name, moved.name, gamma=gamma, alpha=alpha, theta=theta)
    along = np.array([np.cos(gamma), np.sin(gamma), 0.0])
    across = np.array([-np.sin(gamma), np.cos(gamma), 0.0])
    r = -float(across @ shift) / np.sin(alpha)
    b = float(shift[2]) - r * np.cos(alpha)
    return [], Frame(name, before, gamma=gamma, b=b, alpha=alpha, d=float(along @ shift), theta=theta, r=r)


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _about_own_axis(gamma: float, b: float) -> Real:
    moved = np.eye(4)
    cosine, sine = np.cos(gamma), np.sin(gamma)
    moved[:2, :2] = [[cosine, -sine], [sine, cosine]]
    moved[2, 3] = b
    return moved
