"""`SerialChain`: joints in a row and the bodies that they carry, and the robot that is built from it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..kinematics.inverse import reach
from ..kinematics.mechanism import Frame, Mechanism, tool_jacobian
from ..settings import ROBOT
from ..spatial.spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot

BASE = "base"  # joint of the bodies that do not move


@dataclass(frozen=True)
class SerialJoint:
    """One joint: its place on the body before it, its axis, and its stiffness.

    The body after the joint has the name of the joint and stands at ``T(q) = place Rot(axis, q)`` in the axes of the
    body before it; with a prismatic joint at ``place Trans(q axis)``.
    """

    name: str
    motion: str  # revolute or prismatic
    place: Real  # (4, 4), joint at q = 0 in the axes of the body before it
    axis: Real  # (3,), direction in the joint's own axes, of any length
    lower: float = -np.inf  # limits of q, rad or m
    upper: float = np.inf
    # (6,): (K_r, K_r, K_a, K_rr, K_rr, K_ar) about the joint's axis, N/m and N m/rad; infinite: rigid
    stiffness: Real = field(default_factory=lambda: np.full(6, np.inf))

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
    """A rigid part that moves with the body after a joint.

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
    """A serial robot as a URDF or a table of Denavit-Hartenberg parameters describes it.

    Parameters
    ----------
    joints
        Joints from the base to the flange.
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
        No joint, a repeated name, or a part on a joint that does not exist.
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


def place_of(shift: Sequence[float], angles: Sequence[float]) -> Real:
    """Homogeneous matrix (4, 4) of a shift (m) and turns about the fixed axes x, y and z in turn (rad).

    The turns are roll, pitch and yaw as in URDF.

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
    """Shift, m, and roll, pitch, yaw, rad, of a homogeneous matrix: the inverse of `place_of`."""
    rotation = place[:3, :3]
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if np.hypot(rotation[0, 0], rotation[1, 0]) > 1e-12:
        roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
    else:  # pitch +-90 degrees: roll and yaw turn about one axis
        roll, yaw = 0.0, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    return [float(value) for value in place[:3, 3]], [roll, pitch, yaw]


def symmetric(six: Sequence[float]) -> Real:
    """Build a symmetric matrix (3, 3) from ``(xx, yy, zz, xy, xz, yz)``, or from the three diagonal entries."""
    xx, yy, zz, xy, xz, yz = (*six, 0.0, 0.0, 0.0) if len(six) == 3 else six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def six_of(matrix: Real) -> list[float]:
    """Return the entries ``(xx, yy, zz, xy, xz, yz)`` of a symmetric matrix (3, 3)."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [float(matrix[i, j] + matrix[j, i]) / 2 for i, j in pairs]


def inertia_fault(inertia: Real) -> str | None:
    """Return why no rigid body can have this inertia (3, 3), kg m^2, about its centre; None if a body can.

    Principal moments must not be negative, and the largest must not exceed the sum of the two smaller moments.
    """
    if not np.allclose(inertia, inertia.T, rtol=0, atol=1e-9 * max(float(np.abs(inertia).max()), 1e-300)):
        return "it is not symmetric"
    largest = float(np.abs(inertia).max())
    if largest > ROBOT.largest_inertia or 0 < largest < ROBOT.smallest_inertia:
        size = f"size {ROBOT.smallest_inertia:g} to {ROBOT.largest_inertia:g}"
        return f"its largest entry is {largest:.3g}; give kg m^2 ({size})"
    moments = np.linalg.eigvalsh(inertia)
    rounding = 1e-3  # share of the largest moment that rounding of a file's numbers may take
    if moments[0] < -rounding * max(abs(moments[2]), 1e-12):
        return f"a principal moment is negative: {moments[0]:.4g} kg m^2"
    if moments[2] > moments[0] + moments[1] + rounding * moments[2] and moments[0] > rounding * moments[2]:
        return (
            f"principal moments {moments[0]:.4g}, {moments[1]:.4g}, {moments[2]:.4g} kg m^2: no body has one that is "
            "larger than the other two together; check units and axes"
        )
    return None


BASE_FRAME = "base (fixed)"  # name of the frame on which the first joint turns
PARALLEL = 1e-12  # |sin alpha| below which two axes are parallel


@dataclass(frozen=True)
class AxisFrames:
    """Frames of a chain, and the axes of each joint's body in the frame of its joint."""

    frames: tuple[Frame, ...]  # from the base on; moving frames have the names of their joints
    bodies: dict[str, Real]  # axes of the body, (4, 4), by joint; under "0" the axes of the base


def axis_frames(joints: Sequence[SerialJoint], base: Real) -> AxisFrames:
    """Build frames whose z axes are the joints' axes, and as few of them as possible; ``base`` (4, 4) is in the cell.

    ``T = Rot(z, gamma) Trans(z, b) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)`` describes any place unless two
    axes are nearly, but not exactly, parallel. gamma and b turn and shift along the z axis of the frame before, so that
    they can be added to theta and r of that frame: modified Denavit-Hartenberg frames remain (Khalil & Kleinfinger
    1986, section 3). A joint that is compliant across its axis keeps its origin, because its springs are there.
    """
    frames: list[Frame] = []
    bodies: dict[str, Real] = {"0": np.eye(4)}
    body: Real = np.asarray(base, dtype=float)  # axes of the body before, in the frame before
    before, movable = "0", False
    for joint in joints:
        upright = turn_onto(joint.axis)
        target = np.asarray(body @ joint.place @ upright)
        if not frames:  # the first joint has a fixed frame before it, so that its own frame does not depend on the base
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
        before, body = joint.name, bodies[joint.name]
        movable = bool(np.isinf(joint.stiffness[[0, 1, 3, 4]]).all())
    return AxisFrames(tuple(frames), bodies)


def fixed_frames(name: str, before: str, target: Real) -> tuple[Frame, ...]:
    """Build fixed frames, one or two, that place ``target`` (4, 4) in the frame ``before``; the last has the name."""
    placement, frame = _placed(name, before, target)
    return (*placement, replace(frame, motion="fixed"))


def turn_onto(axis: Real) -> Real:
    """Return a rotation, as homogeneous matrix (4, 4), that turns the z axis onto ``axis`` (3,)."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    turn = np.eye(4)
    if x == y == 0:
        turn[:3, :3] = np.diag([1.0, np.sign(z), np.sign(z)])
        return turn
    third = np.array([x, y, z])
    first = np.cross([0.0, 1.0, 0.0] if abs(y) < 0.9 else [0.0, 0.0, 1.0], third)
    first /= np.linalg.norm(first)
    turn[:3, :3] = np.array([first, np.cross(third, first), third]).T
    return turn


def _placed(name: str, before: str, target: Real) -> tuple[list[Frame], Frame]:
    """Build a frame at ``target`` (4, 4); an additional fixed frame carries the shift if digits would be lost."""
    rotation, shift = target[:3, :3], target[:3, 3]
    sine, cosine = float(np.hypot(rotation[0, 2], rotation[1, 2])), float(rotation[2, 2])
    if sine <= PARALLEL:
        sign = 1.0 if cosine > 0 else -1.0
        distance = float(np.hypot(shift[0], shift[1]))
        gamma = float(np.arctan2(shift[1], shift[0])) if distance > PARALLEL else 0.0
        # Rot(z, gamma) Rot(x, 0 or pi) Rot(z, theta): its first column is (cos(gamma +- theta), sin(...), 0)
        total = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        alpha, theta = 0.0 if sign > 0 else np.pi, _wrapped(sign * (total - gamma))
        return [], Frame(name, before, gamma=gamma, b=float(shift[2]), alpha=alpha, d=distance, theta=theta)
    gamma = float(np.arctan2(rotation[0, 2], -rotation[1, 2]))
    if abs(gamma) > np.pi / 2 + 1e-12:  # the other sign of alpha turns the frame before by less
        gamma, sine = gamma - np.copysign(np.pi, gamma), -sine
    alpha = float(np.arctan2(sine, cosine))
    turned = rotation.T @ np.array([np.cos(gamma), np.sin(gamma), 0.0])
    theta = float(np.arctan2(-turned[1], turned[0]))
    if abs(sine) < 1e-3:  # the formula below divides by the sine
        toward = float(np.arctan2(shift[1], shift[0]))
        distance = float(np.hypot(shift[0], shift[1]))
        moved = Frame(f"{name} (place)", before, "fixed", True, toward, float(shift[2]), 0.0, distance, -toward, 0.0)
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


FLANGE, TOOL = "flange (fixed)", "tool (fixed)"  # names of the frames after the last joint


def spatial_robot(chain: SerialChain, **options: Any) -> SpatialRobot:
    """Build the robot in space from a chain: two nodes for each joint, rigid bodies between them, then the tool tip.

    Joint i has node 2 i - 1 on the body before and node 2 i on the body after it, both at its origin; node 0 is the
    clamped base, the last node is the tool tip. Parts on the base are left out, because they do not move.

    Parameters
    ----------
    chain
        Joints and parts of the robot.
    options
        Damping and gravity as :class:`SpatialRobot` takes them: ``rayleigh``, ``damping_ratio``, ``gravity``, ``up``.
    """
    built = axis_frames(chain.joints, chain.base)
    names = [joint.name for joint in chain.joints]
    flange = fixed_frames(FLANGE, names[-1], built.bodies[names[-1]] @ chain.flange)
    tool = fixed_frames(TOOL, FLANGE, chain.tool)
    points: dict[int, tuple[str, Real]] = {0: ("0", np.zeros(3))}
    joints, links = [], []
    before, axes = "0", chain.base
    for number, joint in enumerate(chain.joints):
        first, second = 2 * number + 1, 2 * number + 2
        points[first] = (before, (axes @ joint.place)[:3, 3])
        points[second] = (joint.name, built.bodies[joint.name][:3, 3])
        joints.append(ElasticJoint(joint.name, (first, second), np.asarray(joint.stiffness, dtype=float)))
        links.append(Link((first - 1, first)))
        before, axes = joint.name, built.bodies[joint.name]
    tip = 2 * len(names) + 1
    points[tip] = (TOOL, np.zeros(3))
    links.append(Link((tip - 1, tip)))
    bodies = []
    for part in chain.parts:
        if part.joint != BASE:
            turn = built.bodies[part.joint][:3, :3]
            node = 2 * names.index(part.joint) + 2
            bodies.append(LumpedBody(node, part.joint, part.mass, turn @ part.centre, turn @ part.inertia @ turn.T))
    mechanism = Mechanism((*built.frames, *flange, *tool), TOOL)
    return SpatialRobot(mechanism, tuple(joints), tuple(links), tuple(bodies), points, tip, **options)


def ready_posture(mechanism: Mechanism) -> tuple[Real, bool]:
    """Search a well-conditioned posture with a vertical tool.

    The candidates are a Halton sequence over the inner four fifths of the joint ranges. They are sorted by the smallest
    singular value of the tool's Jacobian (m, rad), weighted by the downward direction of the tool. The first candidate
    whose tool can be turned into the vertical is taken.

    Returns
    -------
    (n_moving,), rad and m, and whether the tool is vertical there
    """
    frames = mechanism.joints
    # nobody starts a robot at the end of a long rail, or after a whole turn
    half = np.array([1.0 if frame.motion == "prismatic" else 2.0 for frame in frames])
    own_lower, own_upper = mechanism.bounds
    lower, upper = np.maximum(own_lower, -half), np.minimum(own_upper, half)
    empty = lower >= upper  # a range far from zero
    lower, upper = np.where(empty, own_lower, lower), np.where(empty, own_upper, upper)
    middle, width = (lower + upper) / 2, 0.8 * (upper - lower)
    samples = middle + width * (scipy.stats.qmc.Halton(len(frames), scramble=False).random(401)[1:] - 0.5)
    turning = [place for place, frame in enumerate(frames) if frame.motion == "revolute"]
    samples[:, turning[:1]] = np.clip(0.0, lower, upper)[turning[:1]]  # turning about the base changes nothing
    scores = []
    for q in samples:
        smallest = float(np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1])
        scores.append(smallest * (1.5 - mechanism.tool_transform(q)[2, 2]))
    order = np.argsort(scores)[::-1]
    for chosen in order[:8]:
        q = samples[chosen]
        target = mechanism.tool_transform(q).copy()
        heading = float(np.arctan2(target[1, 0], target[0, 0]))
        cosine, sine = np.cos(heading), np.sin(heading)
        target[:3, :3] = [[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]]
        try:
            return reach(mechanism, target, q, starts=4), True
        except InputError:
            continue
    return samples[order[0]], False
