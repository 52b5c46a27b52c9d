"""A planar robot with its link sections: beam elements in the plane, joints as torsional springs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from modal_fit import ModalModel

from ..finite_elements import STANDARD_GRAVITY, Section, beam_mass, beam_stiffness, modal_damping_matrix, modal_model
from .planar_robot import TIP_IN_PLANE, PlanarRobot

Real = NDArray[np.float64]

ELEMENTS = 4
"""Beam elements a link: the first modes are within 1e-4 of the exact chain's."""

HIGHEST_MODE = 1500.0
"""Hz; modes above are left as static flexibility: four elements a link put them more than 3 % too high."""

_IN_PLANE = [0, 1, 5, 6, 7, 11]
"""Axial, transverse and rotation of a beam element's two ends."""


@dataclass(frozen=True)
class FlexibleChain:
    """Matrices of a chain of flexible links about a posture, with the base clamped.

    Parameters
    ----------
    mass, stiffness : (n, n)
        Mass and stiffness matrix.
    links : (n_links, n, n)
        Each link's part of the stiffness, with its joint's spring: for its share of the damping.
    ratios : (n_links,)
        Damping ratio of each link with its joint.
    weight : (n,), N and N m
        Load by the links' own weight.
    tip
        Index of the tip's reach; height and rotation follow.
    """

    mass: Real
    stiffness: Real
    links: Real
    ratios: Real
    weight: Real
    tip: int

    def frequencies(self) -> Real:
        """Natural frequencies, Hz, (n,)."""
        return np.asarray(np.sqrt(eigh(self.stiffness, self.mass, eigvals_only=True)) / (2 * np.pi))

    def compliance(self) -> Real:
        """Over reach, height and rotation of the tip, (3, 3)."""
        return np.asarray(np.linalg.inv(self.stiffness)[self.tip :, self.tip :][:3, :3])

    def sag(self) -> Real:
        """Deflection of the tip under the links' weight, (3,), m and rad."""
        moved = np.linalg.solve(self.stiffness, self.weight)
        return np.asarray(moved[self.tip : self.tip + 3])

    def model(self) -> ModalModel:
        """Modal model at the tip, modes up to 1.5 kHz; each is damped by the links that its strain energy is in.

        ``zeta_r = sum_l zeta_l U_lr / U_r`` (Ungar & Kerwin 1962), so that a mode of one joint has that link's ratio.
        """
        _, shapes = eigh(self.stiffness, self.mass)
        energy = np.einsum("nr,lnm,mr->lr", shapes, self.links, shapes, optimize=True)
        ratios = self.ratios @ energy / energy.sum(axis=0)
        damping = modal_damping_matrix(self.mass, self.stiffness, ratios)
        rows = np.zeros((3, len(self.mass)))
        rows[:, self.tip : self.tip + 3] = np.eye(3)
        return modal_model(self.mass, damping, self.stiffness, rows, TIP_IN_PLANE, HIGHEST_MODE)


def flexible_chain(robot: PlanarRobot, angles: Real) -> FlexibleChain:
    """Assemble the chain: a link has a rotation at its start, then reach, height and rotation of each node.

    Neighbouring links share the translations of their joint; its spring joins their rotations (Chen et al. 2026,
    Eqs. 10-17, with elements in place of exact links).

    Parameters
    ----------
    robot
        Planar robot with sections.
    angles : (n_links,), rad
        Relative joint angles of the posture.
    """
    assert robot.sections is not None
    size = len(robot.lengths) * (3 * ELEMENTS + 1)
    mass = np.zeros((size + 3, size + 3))  # the last three: reach, height and rotation of the clamped base
    links = np.zeros((len(robot.lengths), size + 3, size + 3))
    before = [size, size + 1, size + 2]
    for link, (direction, length, section) in enumerate(
        zip(robot.directions(angles), robot.lengths, robot.sections, strict=True)
    ):
        first = link * (3 * ELEMENTS + 1)
        spring = [before[2], first]
        links[link][np.ix_(spring, spring)] += robot.stiffness[link] * np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiff, heavy = (_turned(part, direction) for part in _element(section, length / ELEMENTS))
        node = [before[0], before[1], first]
        for element in range(ELEMENTS):
            start = first + 1 + 3 * element
            after = [start, start + 1, start + 2]
            place = np.ix_([*node, *after], [*node, *after])
            links[link][place] += stiff
            mass[place] += heavy
            node = after
        before = node
    free = slice(0, size)
    weight = -STANDARD_GRAVITY * (mass @ _step_upwards(len(robot.lengths)))
    links = links[:, free, free]
    ratios = np.asarray(robot.damping_ratios, dtype=float)
    return FlexibleChain(mass[free, free], links.sum(axis=0), links, ratios, weight[free], size - 3)


def _step_upwards(n_links: int) -> Real:
    """A unit step of all heights, those of the base's too: (rotation, then reach, height, rotation of nodes) a link."""
    link = [0.0, *([0.0, 1.0, 0.0] * ELEMENTS)]
    return np.array([*(link * n_links), 0.0, 1.0, 0.0])


def _element(section: Section, length: float) -> tuple[Real, Real]:
    place = np.ix_(_IN_PLANE, _IN_PLANE)
    return beam_stiffness(section, length)[place], beam_mass(section, length)[place]


def _turned(local: Real, direction: float) -> Real:
    """Turn axial, transverse and rotation into reach, height and rotation."""
    cosine, sine = np.cos(direction), np.sin(direction)
    turn = np.kron(np.eye(2), np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
    return np.asarray(turn @ local @ turn.T)
