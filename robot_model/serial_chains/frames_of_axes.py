"""The step from joints at any place to frames of Khalil and Kleinfinger, whose z is the joint's axis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..kinematics import Frame
from .serial_chain import SerialJoint

Real = NDArray[np.float64]

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
