"""Statics under rigid links, and the stiffness that gravity adds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import InputError, Real

from ..kinematics.mechanism import drive_direction
from .structure import Structure, rigid_rows, stiffness_matrix

if TYPE_CHECKING:
    from ..spatial.spatial_robot import SpatialRobot


@dataclass(frozen=True)
class ConstrainedSystem:
    """``[[K, A^T], [A, 0]] (x, lambda) = (F, 0)`` without the clamped node (Belchior et al. 2013, Eqs. 13-15).

    Symmetric and invertible, not positive definite as the paper says: a saddle matrix.

    Parameters
    ----------
    stiffness : (n, n)
        Stiffness K over the free nodes, n = 6 (H - 1).
    constraints : (n_rows, n)
        Constraints A over the free nodes.
    whole : (n + n_rows, n + n_rows)
        The rows of A are scaled by ``scale`` to the size of K, so that the matrix is well conditioned.
    tip : int
        Position of the tool's six degrees of freedom.
    """

    stiffness: Real
    constraints: Real
    whole: Real
    scale: float
    tip: int

    def tip_responses(self) -> Real:
        """Displacement of all free nodes for unit forces and moments at the tool, shape (n, 6).

        Raises
        ------
        InputError
            The structure is not held.
        """
        size = len(self.stiffness)
        loads = np.zeros((len(self.whole), 6))
        loads[self.tip : self.tip + 6] = np.eye(6)
        try:
            solved = np.linalg.solve(self.whole, loads)
        except np.linalg.LinAlgError as error:
            raise InputError("the structure is not held: a joint has no stiffness, or a loop is singular") from error
        return np.asarray(solved[:size])


def constrained_system(structure: Structure) -> ConstrainedSystem:
    """The saddle system of a structure with node 0 clamped."""
    stiffness = stiffness_matrix(structure)[6:, 6:]
    constraints = rigid_rows(structure)[:, 6:]
    scale = float(np.median(np.diag(stiffness)[np.diag(stiffness) > 0])) if stiffness.any() else 1.0
    rows = scale * constraints
    whole = np.block([[stiffness, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return ConstrainedSystem(stiffness, constraints, whole, scale, 6 * (structure.tip - 1))


def tip_compliance(structure: Structure) -> Real:
    """Displacement and rotation of the tool over force and moment there, shape (6, 6)."""
    system = constrained_system(structure)
    compliance = system.tip_responses()[system.tip : system.tip + 6]
    return np.asarray((compliance + compliance.T) / 2)


def tip_stiffness(structure: Structure) -> Real:
    """Equivalent stiffness by condensing everything but the tool, shape (6, 6).

    ``K_eq = K_EE - K_ER K_RR^-1 K_RE`` with the multipliers among R (Belchior et al. 2013, Eqs. 16-19 and 24).

    Raises
    ------
    InputError
        The rest cannot be condensed: it is not held when the tool is.
    """
    system = constrained_system(structure)
    tool = np.arange(system.tip, system.tip + 6)
    rest = np.setdiff1d(np.arange(len(system.whole)), tool)
    inner = system.whole[np.ix_(rest, rest)]
    side = system.whole[np.ix_(rest, tool)]
    try:
        condensed = system.whole[np.ix_(tool, tool)] - side.T @ np.linalg.solve(inner, side)
    except np.linalg.LinAlgError as error:
        raise InputError("the structure is not held when its tool is; use tip_compliance") from error
    return np.asarray((condensed + condensed.T) / 2)


STANDARD_GRAVITY = 9.80665
"""m/s^2."""


def with_gravity(robot: SpatialRobot, gravity: float = STANDARD_GRAVITY) -> SpatialRobot:
    """The robot with the stiffness of its own weight, ``gravity`` m/s^2 along the base's -z.

    Raises
    ------
    InputError
        A negative or infinite gravity, or a robot with closed loops.
    """
    if not (np.isfinite(gravity) and gravity >= 0):
        raise InputError(f"gravity {gravity!r} m/s^2 must be zero or more, and finite")
    return replace(robot, gravity=gravity)


def gravity_hessian(robot: SpatialRobot, q: Real, structure: Structure) -> Real:
    """Second derivative of ``V = sum m g z`` over the joint values, N m/rad, shape (n_moving, n_moving).

    A mass at p on a body that joints i and j carry, i nearer to the base, has ``d^2 p / dq_i dq_j = z_i x (z_j x
    (p - o_j))`` with z the joints' axes and o their origins (Siciliano et al., Robotics, section 3.6). Where j is
    prismatic the inner term is z_j; where i is, there is none. This is the spatial form of the term ``sum m_i y_i g``
    of Chen et al. 2026, Eq. 18. Beams count with half their mass at each end; links are taken as rigid in this term,
    so that joints alone turn the weight.
    """
    mechanism = robot.mechanism
    placed = mechanism.transforms(q)
    size = len(mechanism.moving)
    hessian = np.zeros((size, size))
    for frame, mass, place in _masses(robot, structure):
        carried = [
            column for column, index in enumerate(mechanism.moving) if frame >= 0 and _carries(robot, index, frame)
        ]
        for position, first in enumerate(carried):
            for second in carried[position:]:
                if mechanism.frames[mechanism.moving[first]].motion == "prismatic":
                    continue
                near, far = (placed[mechanism.moving[column]] for column in (first, second))
                slides = mechanism.frames[mechanism.moving[second]].motion == "prismatic"
                moved = far[:3, 2] if slides else np.cross(far[:3, 2], place - far[:3, 3])
                bend = np.cross(near[:3, 2], moved)
                hessian[first, second] += mass * robot.gravity * float(np.asarray(robot.up) @ bend)
                hessian[second, first] = hessian[first, second]
    return hessian


def gravity_torques(robot: SpatialRobot, q: Real, structure: Structure, acceleration: float) -> Real:
    """``-dV/dq`` of ``V = sum m g h``: how the weight turns (N m) or pushes (N) each moving joint, shape (n_moving,).

    A mass at p on a body that joint i carries gives ``-m g u . (z_i x (p - o_i))``, or ``-m g u . z_i`` of a prismatic
    joint, with u upwards (Siciliano et al., Robotics, section 7.3.1).
    """
    mechanism = robot.mechanism
    placed, up = mechanism.transforms(q), np.asarray(robot.up)
    torques = np.zeros(len(mechanism.moving))
    for frame, mass, place in _masses(robot, structure):
        for column, index in enumerate(mechanism.moving):
            if frame >= 0 and _carries(robot, index, frame):
                axis, origin = placed[index, :3, 2], placed[index, :3, 3]
                slides = mechanism.frames[index].motion == "prismatic"
                torques[column] -= (
                    mass * acceleration * float(up @ (axis if slides else np.cross(axis, place - origin)))
                )
    return torques


def gravity_stiffness(robot: SpatialRobot, q: Real, structure: Structure) -> Real:
    """The same over all nodes, (6 H, 6 H): ``S^T G S`` with S each joint's relative motion on its axis."""
    hessian = gravity_hessian(robot, q, structure)
    rows = np.zeros((len(hessian), 6 * len(structure.positions)))
    moving = [robot.mechanism.frames[index] for index in robot.mechanism.moving]
    first = {joint.frame: spring for joint, spring in zip(robot.joints[::-1], structure.springs[::-1], strict=True)}
    nodes = {joint.frame: joint.nodes for joint in robot.joints[::-1]}
    for row, frame in zip(rows, moving, strict=True):
        if frame.name not in first:
            continue
        spring = replace(first[frame.name], nodes=nodes[frame.name])  # from body to body, past a drive's rotor
        motions = spring.motions(structure.positions)
        for node, sign, motion in zip(spring.nodes, (-1.0, 1.0), motions, strict=True):
            row[6 * node : 6 * node + 6] += sign * motion[drive_direction(frame)]
    return np.asarray(rows.T @ hessian @ rows)


def _masses(robot: SpatialRobot, structure: Structure) -> list[tuple[int, float, Real]]:
    """Frame that carries it (-1: the base), mass and place of every lump."""
    owner = {node: name for node, (name, _) in robot.points.items()}
    for joint in robot.joints:
        owner.setdefault(joint.nodes[0], _before(robot, joint.frame))
        owner[joint.nodes[1]] = joint.frame
    lumps = [
        (_index(robot, body.frame), body.mass, structure.positions[body.node] + placed.centre)
        for body, placed in zip(robot.bodies, structure.bodies, strict=True)
    ]
    for link in robot.links:
        if link.section is None:
            continue
        ends = structure.positions[list(link.nodes)]
        half = link.section.mass * float(np.linalg.norm(ends[1] - ends[0])) / 2
        lumps += [(_index(robot, owner.get(link.nodes[0], "0")), half, end) for end in ends]
    return lumps


def _before(robot: SpatialRobot, frame: str) -> str:
    return robot.mechanism.frames[robot.mechanism.index(frame)].antecedent


def _index(robot: SpatialRobot, name: str) -> int:
    return -1 if name == "0" else robot.mechanism.index(name)


def _carries(robot: SpatialRobot, joint: int, frame: int) -> bool:
    """Whether the joint at one frame moves the body of another."""
    while frame >= 0:
        if frame == joint:
            return True
        frame = _index(robot, robot.mechanism.frames[frame].antecedent)
    return False
