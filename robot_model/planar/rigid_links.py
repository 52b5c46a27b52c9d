"""Rigid links on joint springs: the Lagrange model of a planar chain, linear about a posture."""

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..finite_elements.gravity import STANDARD_GRAVITY
from ..finite_elements.modal_damping import modal_damping_matrix
from ..finite_elements.modal_reduction import modal_model
from .planar_robot import TIP_IN_PLANE, PlanarRobot

Real = NDArray[np.float64]

GRAVITY = 9.80665


def rigid_matrices(robot: PlanarRobot, angles: Real, gravity: float = 0.0) -> tuple[Real, Real]:
    """Mass and stiffness matrix in the small joint rotations, each (n_links, n_links), kg m^2 and N m/rad.

    ``T = 1/2 sum (J_i psi_i'^2 + m_i v_i^2)`` with ``J_i = m_i a_i^2 / 12`` about the middle of a uniform link and
    ``V = 1/2 sum k_i theta_i^2 + sum m_i g y_i`` (Chen et al. 2026, Eqs. 18-19). ``theta_i`` are relative rotations;
    the second derivative of the gravity term is ``-sum m g y`` of what a joint carries, added to ``diag(k)``.

    Parameters
    ----------
    robot, angles : (n_links,), rad
        Relative joint angles of the posture.
    gravity
        m/s^2, in the direction of falling height; 0 leaves its stiffness out, as the figures of the paper do.
    """
    n_links = len(robot.lengths)
    directions = robot.directions(angles)
    along = robot.lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    starts = np.vstack([np.zeros(2), np.cumsum(along, axis=0)[:-1]])
    mass = np.zeros((n_links, n_links))
    stiffness = np.diag(np.asarray(robot.stiffness, dtype=float))
    for link in range(n_links):
        arm = starts[link] + along[link] / 2 - starts[: link + 1]
        velocity = np.zeros((2, n_links))
        velocity[:, : link + 1] = np.column_stack([-arm[:, 1], arm[:, 0]]).T
        rotation = np.where(np.arange(n_links) <= link, 1.0, 0.0)
        weight = robot.masses[link]
        mass += weight * velocity.T @ velocity + weight * robot.lengths[link] ** 2 / 12 * np.outer(rotation, rotation)
        outer = np.maximum.outer(np.arange(link + 1), np.arange(link + 1))
        stiffness[: link + 1, : link + 1] -= gravity * weight * arm[outer, 1]
    return mass, stiffness


def tip_jacobian(robot: PlanarRobot, angles: Real) -> Real:
    """Reach, height and rotation of the tip over the joint rotations, shape (3, n_links)."""
    directions = robot.directions(angles)
    along = robot.lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    arm = np.cumsum(along[::-1], axis=0)[::-1]
    return np.vstack([-arm[:, 1], arm[:, 0], np.ones(len(arm))])


def planar_compliance(robot: PlanarRobot, angles: Real) -> Real:
    """``J K^-1 J^T`` over reach, height and rotation of the tip, shape (3, 3)."""
    tip = tip_jacobian(robot, angles)
    return np.asarray((tip / np.asarray(robot.stiffness, dtype=float)) @ tip.T)


def planar_sag(robot: PlanarRobot, angles: Real) -> Real:
    """Deflection of the tip under the links' own weight, ``J K^-1 tau`` with ``tau = -dV/dtheta``, shape (3,)."""
    directions = robot.directions(angles)
    along = robot.lengths * np.cos(directions)
    middles = np.cumsum(along) - along / 2
    starts = np.cumsum(along) - along
    levers = np.array([np.sum(robot.masses[i:] * (middles[i:] - starts[i])) for i in range(len(along))])
    torques = -STANDARD_GRAVITY * levers
    return np.asarray(tip_jacobian(robot, angles) @ (torques / np.asarray(robot.stiffness, dtype=float)))


def rigid_model(robot: PlanarRobot, angles: Real, gravity: float = 0.0) -> ModalModel:
    """Modal model at the tip with the robot's damping ratios, one a mode in rising frequency.

    Examples
    --------
    >>> from robot_model import read_planar_robot
    >>> chen = read_planar_robot("chen_2026")
    >>> [round(float(rigid_model(chen.robot, pose).natural_frequencies[0]), 2) for pose in chen.poses.values()]
    [11.96, 11.79, 11.4]
    """
    mass, stiffness = rigid_matrices(robot, angles, gravity)
    damping = modal_damping_matrix(mass, stiffness, robot.damping_ratios)
    return modal_model(mass, damping, stiffness, tip_jacobian(robot, angles), TIP_IN_PLANE)
