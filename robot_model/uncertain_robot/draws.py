"""Robots that an updated file leaves possible: shifts of its uncertain numbers, one by one or drawn."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..full_update import FOUNDATION, LEAST_COMPLIANCE, changed_by, payload_centre, point_mass
from ..spatial import SpatialRobot
from .uncertainty import RobotUncertainty

Real = NDArray[np.float64]


def shifted_robot(robot: SpatialRobot, uncertainty: RobotUncertainty, shift: Real) -> SpatialRobot:
    """The updated robot with its numbers shifted further.

    A payload that the file has already is exchanged for the shifted one. A compliance that falls below zero is none.

    Parameters
    ----------
    robot
        The robot as the updated file has it.
    uncertainty
        Its ``[update]`` table.
    shift : (n_parameters,)
        Shifts, in the parameters' units.
    """
    parameters, own = uncertainty.parameters, np.asarray(shift, dtype=float).copy()
    of_payload = {one.axis: i for i, one in enumerate(parameters) if one.kind == "payload"}
    bodies = []
    if of_payload:
        was = {axis: uncertainty.values[i] for axis, i in of_payload.items()}
        now = {axis: uncertainty.values[i] + own[i] for axis, i in of_payload.items()}
        for sign, numbers in ((-1.0, was), (1.0, now)):
            place = payload_centre(robot) + np.array([numbers.get(axis, 0.0) for axis in range(3)])
            bodies.append(point_mass(robot, sign * numbers.get(3, 0.0), place))
        own[list(of_payload.values())] = 0.0
    base = [i for i, one in enumerate(parameters) if one.kind == "base"]
    grounded = _with_base(robot, {parameters[i].axis: float(own[i]) for i in base})
    if grounded is not robot:
        own[base] = 0.0
    changed = changed_by(grounded, parameters, own)
    return replace(changed, bodies=(*changed.bodies, *(body for body in bodies if body.mass)))


def _with_base(robot: SpatialRobot, added: dict[int, float]) -> SpatialRobot:
    """Shift the compliances of a base's springs where the file has them."""
    joints = []
    for joint in robot.joints:
        if joint.frame != FOUNDATION:
            joints.append(joint)
            continue
        compliance = 1 / joint.stiffness
        for axis, places in ((0, [3, 4]), (1, [0, 1])):
            shifted = compliance[places] + added.get(axis, 0.0)
            compliance[places] = np.where(shifted > LEAST_COMPLIANCE, shifted, 0.0)
        with np.errstate(divide="ignore"):
            joints.append(replace(joint, stiffness=1 / compliance))
    found = tuple(joints)
    return robot if all(a is b for a, b in zip(found, robot.joints, strict=True)) else replace(robot, joints=found)


def principal_shifts(uncertainty: RobotUncertainty) -> Real:
    """Shifts S (n_directions, n_parameters) with ``S^T S`` the covariance: one standard deviation each."""
    size = np.sqrt(np.diag(uncertainty.covariance))
    scale = np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(uncertainty.covariance / np.outer(scale, scale))
    kept = values > 1e-12
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T * scale)


def drawn_robots(
    robot: SpatialRobot, uncertainty: RobotUncertainty, count: int, seed: int = 0
) -> Iterator[SpatialRobot]:
    """Draw robots from what the update left open, normally distributed."""
    shifts = principal_shifts(uncertainty)
    generator = np.random.default_rng(seed)
    for weights in generator.normal(size=(count, len(shifts))):
        yield shifted_robot(robot, uncertainty, weights @ shifts)
