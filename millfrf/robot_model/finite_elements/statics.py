"""Statics under rigid links, and the load and stiffness by gravity."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import InputError, Real

from ..kinematics.mechanism import drive_direction
from .structure import Structure, rigid_rows, stiffness_matrix

if TYPE_CHECKING:
    from ..spatial.spatial_robot import SpatialRobot

STANDARD_GRAVITY = 9.80665  # m/s^2, by definition


@dataclass(frozen=True)
class ConstrainedSystem:
    """The system ``[[K, A^T], [A, 0]] (x, lambda) = (F, 0)`` without the clamped node (Belchior et al., Eqs. 13-15).

    The matrix is symmetric and invertible, but indefinite (a saddle matrix); the paper calls it positive definite.
    """

    stiffness: Real  # K over the free nodes, (n, n), n = 6 (n_nodes - 1)
    constraints: Real  # A over the free nodes, (n_rows, n)
    matrix: Real  # (n + n_rows, n + n_rows), with A scaled to the size of K for a good condition number
    tip: int  # index of the tool's six degrees of freedom

    def tip_responses(self) -> Real:
        """Compute the displacement of all free nodes for unit forces and moments at the tool, (n, 6)."""
        loads = np.zeros((len(self.matrix), 6))
        loads[self.tip : self.tip + 6] = np.eye(6)
        try:
            solution = np.linalg.solve(self.matrix, loads)
        except np.linalg.LinAlgError as error:
            raise InputError("the structure is not held: a joint has no stiffness, or a loop is singular") from error
        return np.asarray(solution[: len(self.stiffness)])


def constrained_system(structure: Structure) -> ConstrainedSystem:
    """Assemble the constrained system of a structure with node 0 clamped."""
    stiffness = stiffness_matrix(structure)[6:, 6:]
    constraints = rigid_rows(structure)[:, 6:]
    scale = float(np.median(np.diag(stiffness)[np.diag(stiffness) > 0])) if stiffness.any() else 1.0
    rows = scale * constraints
    matrix = np.block([[stiffness, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    return ConstrainedSystem(stiffness, constraints, matrix, 6 * (structure.tip - 1))


def tip_compliance(structure: Structure) -> Real:
    """Compute displacement and rotation of the tool per force and moment on the tool, shape (6, 6)."""
    system = constrained_system(structure)
    compliance = system.tip_responses()[system.tip : system.tip + 6]
    return np.asarray((compliance + compliance.T) / 2)


def tip_stiffness(structure: Structure) -> Real:
    """Compute the stiffness at the tip, (6, 6), by elimination of all other degrees of freedom and multipliers.

    ``K_eq = K_EE - K_ER K_RR^-1 K_RE`` (Belchior et al. 2013, Eqs. 16-19 and 24).
    """
    system = constrained_system(structure)
    tool = np.arange(system.tip, system.tip + 6)
    others = np.setdiff1d(np.arange(len(system.matrix)), tool)
    side = system.matrix[np.ix_(others, tool)]
    try:
        inner = np.linalg.solve(system.matrix[np.ix_(others, others)], side)
    except np.linalg.LinAlgError as error:
        raise InputError("the structure is not held if its tool is; use tip_compliance") from error
    condensed = system.matrix[np.ix_(tool, tool)] - side.T @ inner
    return np.asarray((condensed + condensed.T) / 2)


def with_gravity(robot: SpatialRobot, gravity: float = STANDARD_GRAVITY) -> SpatialRobot:
    """Return the robot with gravity switched on, so that weight adds stiffness; ``gravity`` in m/s^2."""
    if not (np.isfinite(gravity) and gravity >= 0):
        raise InputError(f"gravity {gravity!r} m/s^2 must be zero or more, and finite")
    return replace(robot, gravity=gravity)


def gravity_hessian(robot: SpatialRobot, q: Real, structure: Structure) -> Real:
    """Compute the second derivative of ``V = sum m g z`` over the joint values, N m/rad, (n_moving, n_moving).

    A mass at p that moves with joints i and j, i nearer to the base, has ``d^2 p / dq_i dq_j = z_i x (z_j x
    (p - o_j))`` with the axes z and origins o of the joints (Siciliano et al., Robotics, section 3.6). If j is
    prismatic, ``z_j`` replaces ``z_j x (p - o_j)``; if i is prismatic, the derivative is zero. This is the spatial form
    of the term ``sum m_i y_i g`` of Chen et al. 2026, Eq. 18. A beam has half of its mass at each end, and is rigid.
    """
    mechanism = robot.mechanism
    placed = mechanism.transforms(q)
    hessian = np.zeros((len(mechanism.moving), len(mechanism.moving)))
    for frame, mass, place in _masses(robot, structure):
        carriers = _carriers(robot, frame)
        for position, first in enumerate(carriers):
            for second in carriers[position:]:
                if mechanism.joints[first].motion == "prismatic":
                    continue
                near, far = (placed[mechanism.moving[column]] for column in (first, second))
                slides = mechanism.joints[second].motion == "prismatic"
                velocity = far[:3, 2] if slides else np.cross(far[:3, 2], place - far[:3, 3])
                bend = np.cross(near[:3, 2], velocity)
                hessian[first, second] += mass * robot.gravity * float(np.asarray(robot.up) @ bend)
                hessian[second, first] = hessian[first, second]
    return hessian


def gravity_torques(robot: SpatialRobot, q: Real, structure: Structure, acceleration: float) -> Real:
    """Compute torque (N m) or force (N) of the weight on each moving joint, (n_moving,): ``-dV/dq``, ``V = sum m g h``.

    A mass at p that moves with joint i gives ``-m g u . (z_i x (p - o_i))``, or ``-m g u . z_i`` for a prismatic
    joint, with u upwards (Siciliano et al., Robotics, section 7.3.1). ``acceleration`` is g, m/s^2.
    """
    mechanism = robot.mechanism
    placed, up = mechanism.transforms(q), np.asarray(robot.up)
    torques = np.zeros(len(mechanism.moving))
    for frame, mass, place in _masses(robot, structure):
        for column in _carriers(robot, frame):
            axis, origin = placed[mechanism.moving[column], :3, 2], placed[mechanism.moving[column], :3, 3]
            slides = mechanism.joints[column].motion == "prismatic"
            torques[column] -= mass * acceleration * float(up @ (axis if slides else np.cross(axis, place - origin)))
    return torques


def gravity_stiffness(robot: SpatialRobot, q: Real, structure: Structure) -> Real:
    """Compute the stiffness that weight adds, over all nodes, (6 n_nodes, 6 n_nodes).

    It is ``S^T G S`` with G from :func:`gravity_hessian` and S the relative motion in each joint along or about its
    axis.
    """
    hessian = gravity_hessian(robot, q, structure)
    rows = np.zeros((len(hessian), 6 * len(structure.positions)))
    # reversed, because the first of several springs at a frame counts
    first = {joint.frame: spring for joint, spring in zip(robot.joints[::-1], structure.springs[::-1], strict=True)}
    nodes = {joint.frame: joint.nodes for joint in robot.joints[::-1]}
    for row, frame in zip(rows, robot.mechanism.joints, strict=True):
        if frame.name in first:
            spring = replace(first[frame.name], nodes=nodes[frame.name])  # from body to body, past a drive's rotor
            row += spring.relative_motion(structure.positions)[drive_direction(frame)]
    return np.asarray(rows.T @ hessian @ rows)


def _masses(robot: SpatialRobot, structure: Structure) -> list[tuple[int, float, Real]]:
    """List every lumped mass: index of the frame that carries it (-1: the base), mass in kg, and place in m."""
    owner = {node: name for node, (name, _) in robot.points.items()}
    for joint in robot.joints:
        before = robot.mechanism.frames[robot.mechanism.index(joint.frame)].antecedent
        owner.setdefault(joint.nodes[0], before)
        owner[joint.nodes[1]] = joint.frame
    masses = [
        (_index(robot, body.frame), body.mass, structure.positions[body.node] + placed.centre)
        for body, placed in zip(robot.bodies, structure.bodies, strict=True)
    ]
    for link in robot.links:
        if link.section is not None:
            ends = structure.positions[list(link.nodes)]
            half = link.section.mass * float(np.linalg.norm(ends[1] - ends[0])) / 2
            masses += [(_index(robot, owner.get(link.nodes[0], "0")), half, end) for end in ends]
    return masses


def _index(robot: SpatialRobot, name: str) -> int:
    return -1 if name == "0" else robot.mechanism.index(name)


def _carriers(robot: SpatialRobot, frame: int) -> list[int]:
    """Return the indices in q of all joints between the base and a frame, in rising order."""
    carriers = set()
    while frame >= 0:
        carriers.add(frame)
        frame = _index(robot, robot.mechanism.frames[frame].antecedent)
    return [column for column, index in enumerate(robot.mechanism.moving) if index in carriers]
