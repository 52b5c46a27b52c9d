"""Planar robots: rigid or flexible links on torsional joint springs (Chen et al. 2026)."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real
from modal_fit import ModalModel

from .finite_elements.beam_element import Section, beam_mass, beam_stiffness
from .finite_elements.reduction import modal_damping_matrix, modal_model
from .finite_elements.statics import STANDARD_GRAVITY

TIP_IN_PLANE = ("TCP:+X", "TCP:+Z", "TCP:-RY")
"""Reach, height, and the rotation that turns reach towards height."""


@dataclass(frozen=True)
class PlanarRobot:
    """A chain of uniform links; each joint is a torsional spring against the link before it.

    Parameters
    ----------
    lengths : (n_links,), m
        Lengths of the links.
    masses : (n_links,), kg
        Masses of the links.
    stiffness : (n_links,), N m/rad
        Stiffness of the joint before each link; the first stands on the base.
    damping_ratios : (n_links,)
        Damping ratios, one a mode of the rigid model; ``2 zeta`` is taken for the loss factor of link and joint in the
        exact model.
    sections
        Cross-sections of the links where they are flexible; None: the links are rigid.

    Raises
    ------
    InputError
        Columns of unequal length, or values that are not positive.
    """

    lengths: Real
    masses: Real
    stiffness: Real
    damping_ratios: Real
    sections: tuple[Section, ...] | None = None

    def __post_init__(self) -> None:
        columns = {"lengths": self.lengths, "masses": self.masses, "stiffness": self.stiffness}
        for name, column in columns.items():
            if len(column) != len(self.lengths) or not np.all(np.asarray(column) > 0):
                raise InputError(f"planar robot: {name} = {np.asarray(column)} must be positive, one for each link")
        if len(self.damping_ratios) != len(self.lengths) or np.any(np.asarray(self.damping_ratios) < 0):
            raise InputError(f"planar robot: damping_ratios = {self.damping_ratios} must be 0 or more, one a link")
        if self.sections is not None and len(self.sections) != len(self.lengths):
            raise InputError(f"planar robot: {len(self.sections)} sections for {len(self.lengths)} links")

    def directions(self, angles: Real) -> Real:
        """Absolute angle of each link from the horizontal, rad, from the relative joint angles (n_links,)."""
        given = np.asarray(angles, dtype=float)
        if given.shape != self.lengths.shape:
            raise InputError(f"planar robot: {given.size} joint angles for {len(self.lengths)} links; give one each")
        return np.cumsum(given)

    def tip(self, angles: Real) -> Real:
        """Reach and height of the tip from the first joint, m, shape (2,)."""
        directions = self.directions(angles)
        return np.array([self.lengths @ np.cos(directions), self.lengths @ np.sin(directions)])


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
        return np.asarray(np.sqrt(scipy.linalg.eigh(self.stiffness, self.mass, eigvals_only=True)) / (2 * np.pi))

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
        _, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
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
    >>> from millfrf.robot_model import read_planar_robot
    >>> chen = read_planar_robot("chen_2026")
    >>> [round(float(rigid_model(chen.robot, pose).natural_frequencies[0]), 2) for pose in chen.poses.values()]
    [11.96, 11.79, 11.4]
    """
    mass, stiffness = rigid_matrices(robot, angles, gravity)
    damping = modal_damping_matrix(mass, stiffness, robot.damping_ratios)
    return modal_model(mass, damping, stiffness, tip_jacobian(robot, angles), TIP_IN_PLANE)
