"""A planar robot of exact flexible links: dynamic stiffness assembled, and coupled receptances beside it."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from foundation import InputError

from ..planar.planar_robot import TIP_IN_PLANE, PlanarRobot
from .exact_beam import planar_dynamic_stiffness
from .receptance_coupling import block_diagonal, couple_receptances

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def exact_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """Compute the receptance at the tip (reach, height, rotation) with the exact dynamic stiffness of the links.

    Neighbouring links share translations and have a rotation each, with the joint's spring between them (Chen et al.
    2026, Eqs. 10-17; the first spring stands on the base).

    Parameters
    ----------
    robot, angles : (n_links,), rad
        A robot with sections; relative joint angles.
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines.

    Raises
    ------
    InputError
        The robot has no sections: its links are rigid.
    """
    links = _link_stiffness(robot, angles, frequencies)
    n_links = len(robot.lengths)
    # node i has u, v, the rotation of the link before it and that of the link after it
    whole = np.zeros((len(frequencies), 4 * n_links + 4, 4 * n_links + 4), dtype=complex)
    for link in range(n_links):
        start, end = 4 * link, 4 * link + 4
        dofs = [start, start + 1, start + 3, end, end + 1, end + 2]
        whole[np.ix_(range(len(frequencies)), dofs, dofs)] += links[link]
        spring = robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link])
        before, after = start + 2, start + 3
        whole[:, before, before] += spring
        whole[:, after, after] += spring
        whole[:, before, after] -= spring
        whole[:, after, before] -= spring
    free = np.arange(3, 4 * n_links + 3)  # the base holds u, v and the rotation before the first joint
    inverse: Complex = np.linalg.inv(whole[:, free[:, None], free]).astype(complex)
    return _tip_frf(frequencies, inverse[:, -3:, -3:])


def coupled_receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Frf:
    """The same by receptance coupling of free links (Chen et al. 2026, Eqs. 4-7); frequencies above 0."""
    if np.min(frequencies) <= 0:
        raise InputError("free links have no receptance at 0 Hz; ask for frequencies above 0, or exact_receptance")
    links: list[Complex] = [
        np.linalg.inv(stiffness).astype(complex) for stiffness in _link_stiffness(robot, angles, frequencies)
    ]
    ground = np.zeros((len(frequencies), 3, 3), dtype=complex)
    apart = block_diagonal([ground, *links])
    pairs: list[tuple[int, int]] = []
    compliance: list[complex] = []
    for link in range(len(links)):
        before, after = (0 if link == 0 else 6 * link), 3 + 6 * link
        pairs += [(before + axis, after + axis) for axis in range(3)]
        compliance += [0, 0, 1 / (robot.stiffness[link] * (1 + 2j * robot.damping_ratios[link]))]
    return _tip_frf(frequencies, couple_receptances(apart, pairs, compliance)[:, -3:, -3:])


def _link_stiffness(robot: PlanarRobot, angles: Real, frequencies: Real) -> list[Complex]:
    """Each link in the frame of the base, ``R^T D R`` (Chen et al. 2026, Eq. 8), shape (n_frequencies, 6, 6)."""
    if robot.sections is None:
        raise InputError("the robot's links are rigid; give sections, or use rigid_model")
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)
    links = []
    for direction, length, section, ratio in zip(
        robot.directions(angles), robot.lengths, robot.sections, robot.damping_ratios, strict=True
    ):
        cosine, sine = np.cos(direction), np.sin(direction)
        turn = np.kron(np.eye(2), np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
        links.append(turn.T @ planar_dynamic_stiffness(section, length, omega, 2 * ratio) @ turn)
    return links


def _tip_frf(frequencies: Real, values: Complex) -> Frf:
    axis = np.asarray(frequencies, dtype=float)
    return Frf(axis, values, TIP_IN_PLANE, TIP_IN_PLANE, "receptance", "m/N", np.ones(len(axis), dtype=bool))
