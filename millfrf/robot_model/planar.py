"""Planar robots: rigid or flexible links on torsional joint springs (Chen et al. 2026)."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real
from modal_fit import ModalModel

from .finite_elements.beam_element import Section, beam_mass, beam_stiffness
from .finite_elements.statics import STANDARD_GRAVITY
from .finite_elements.structure import modal_damping_matrix, modal_model, undamped_frequencies
from .settings import ROBOT

TIP_IN_PLANE = ("TCP:+X", "TCP:+Z", "TCP:-RY")  # reach, height, and the rotation that turns reach towards height


@dataclass(frozen=True)
class PlanarRobot:
    """A chain of uniform links; each joint is a torsional spring between a link and the link before it.

    Parameters
    ----------
    lengths : (n_links,), m
        Lengths of the links.
    masses : (n_links,), kg
        Masses of the links.
    stiffness : (n_links,), N m/rad
        Stiffness of the joint before each link; the first stands on the base.
    damping_ratios : (n_links,)
        Damping ratios, one for each mode of the rigid model. In the exact model ``2 zeta`` is the loss factor of link
        and joint.
    sections
        Cross-sections of flexible links; None: the links are rigid.

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
            raise InputError(f"planar robot: damping_ratios = {self.damping_ratios} must be 0 or more, one per link")
        if self.sections is not None and len(self.sections) != len(self.lengths):
            raise InputError(f"planar robot: {len(self.sections)} sections for {len(self.lengths)} links")

    def directions(self, angles: Real) -> Real:
        """Compute the angle of each link from the horizontal, rad, from the relative joint angles (n_links,), rad."""
        angles = np.asarray(angles, dtype=float)
        if angles.shape != self.lengths.shape:
            raise InputError(f"planar robot: {angles.size} joint angles for {len(self.lengths)} links; give one each")
        return np.cumsum(angles)

    def link_vectors(self, angles: Real) -> Real:
        """Reach and height from the start to the end of each link, m, shape (n_links, 2)."""
        directions = self.directions(angles)
        return np.asarray(self.lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)]))

    def tip(self, angles: Real) -> Real:
        """Reach and height of the tip from the first joint, m, shape (2,)."""
        directions = self.directions(angles)
        return np.array([self.lengths @ np.cos(directions), self.lengths @ np.sin(directions)])


@dataclass(frozen=True)
class FlexibleChain:
    """Matrices of a chain of flexible links about a posture, with the base clamped."""

    mass: Real  # (n, n)
    stiffness: Real  # (n, n)
    links: Real  # (n_links, n, n), each link's share of the stiffness, with its joint's spring
    ratios: Real  # (n_links,), damping ratio of each link with its joint
    weight: Real  # (n,), N and N m, load by the links' own weight
    tip: int  # index of the tip's reach; height and rotation follow

    def frequencies(self) -> Real:
        """Natural frequencies, Hz, (n,)."""
        return undamped_frequencies(self.mass, self.stiffness)

    def compliance(self) -> Real:
        """Compliance over reach, height and rotation of the tip, (3, 3)."""
        return np.asarray(np.linalg.inv(self.stiffness)[self.tip :, self.tip :][:3, :3])

    def sag(self) -> Real:
        """Deflection of the tip under the links' weight, (3,), m and rad."""
        deflection = np.linalg.solve(self.stiffness, self.weight)
        return np.asarray(deflection[self.tip : self.tip + 3])

    def model(self) -> ModalModel:
        """Compute the modal model at the tip; strain energies weight the links' damping ratios in each mode.

        ``zeta_r = sum_l zeta_l U_lr / U_r`` (Ungar & Kerwin 1962): a mode that strains a single link has its ratio.
        """
        _, shapes = scipy.linalg.eigh(self.stiffness, self.mass)
        energy = np.einsum("nr,lnm,mr->lr", shapes, self.links, shapes, optimize=True)
        ratios = self.ratios @ energy / energy.sum(axis=0)
        damping = modal_damping_matrix(self.mass, self.stiffness, ratios)
        rows = np.zeros((3, len(self.mass)))
        rows[:, self.tip : self.tip + 3] = np.eye(3)
        return modal_model(self.mass, damping, self.stiffness, rows, TIP_IN_PLANE, ROBOT.planar_band)


def flexible_chain(robot: PlanarRobot, angles: Real) -> FlexibleChain:
    """Assemble a chain of flexible links at the relative joint angles (n_links,), rad.

    The coordinates of a link are the rotation at its start, then reach, height and rotation of each node. Neighbouring
    links have equal translations at their joint, and the joint's spring connects their rotations (Chen et al. 2026,
    Eqs. 10-17, with elements in place of exact links).
    """
    assert robot.sections is not None
    n_links, elements = len(robot.lengths), ROBOT.planar_elements
    size = n_links * (3 * elements + 1)
    mass = np.zeros((size + 3, size + 3))  # the last three: reach, height and rotation of the clamped base
    links = np.zeros((n_links, size + 3, size + 3))
    before = [size, size + 1, size + 2]
    for link, (direction, length, section) in enumerate(
        zip(robot.directions(angles), robot.lengths, robot.sections, strict=True)
    ):
        first = link * (3 * elements + 1)
        spring = [before[2], first]
        links[link][np.ix_(spring, spring)] += robot.stiffness[link] * np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiffness, inertia = (_planar(m(section, length / elements), direction) for m in (beam_stiffness, beam_mass))
        node = [before[0], before[1], first]
        for element in range(elements):
            start = first + 1 + 3 * element
            after = [start, start + 1, start + 2]
            block = np.ix_([*node, *after], [*node, *after])
            links[link][block] += stiffness
            mass[block] += inertia
            node = after
        before = node
    step = np.array([*([0.0, *([0.0, 1.0, 0.0] * elements)] * n_links), 0.0, 1.0, 0.0])  # all heights move by one
    weight = -STANDARD_GRAVITY * (mass @ step)
    free = slice(0, size)
    links = links[:, free, free]
    ratios = np.asarray(robot.damping_ratios, dtype=float)
    return FlexibleChain(mass[free, free], links.sum(axis=0), links, ratios, weight[free], size - 3)


def _planar(local: Real, direction: float) -> Real:
    """Reduce a beam element's matrix (12, 12) to reach, height and rotation of its ends, (6, 6)."""
    in_plane = [0, 1, 5, 6, 7, 11]  # axial, transverse and rotation of both ends
    cosine, sine = np.cos(direction), np.sin(direction)
    turn = np.kron(np.eye(2), np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]))
    return np.asarray(turn @ local[np.ix_(in_plane, in_plane)] @ turn.T)


def rigid_matrices(robot: PlanarRobot, angles: Real, gravity: float = 0.0) -> tuple[Real, Real]:
    """Compute mass and stiffness in the small joint rotations, each (n_links, n_links), kg m^2 and N m/rad.

    ``T = 1/2 sum (J_i psi_i'^2 + m_i v_i^2)`` with ``J_i = m_i a_i^2 / 12`` about the middle of a uniform link and
    ``V = 1/2 sum k_i theta_i^2 + sum m_i g y_i`` (Chen et al. 2026, Eqs. 18-19). ``theta_i`` are relative rotations;
    the second derivative of the gravity term is ``-sum m g y`` of the links that a joint carries, added to ``diag(k)``.

    Parameters
    ----------
    robot
        Planar robot; its sections are ignored.
    angles : (n_links,), rad
        Relative joint angles of the posture.
    gravity
        Acceleration in the direction of falling height, m/s^2; 0 neglects its stiffness, as the paper's figures do.
    """
    n_links = len(robot.lengths)
    along = robot.link_vectors(angles)
    starts = np.vstack([np.zeros(2), np.cumsum(along, axis=0)[:-1]])
    mass = np.zeros((n_links, n_links))
    stiffness = np.diag(np.asarray(robot.stiffness, dtype=float))
    for link in range(n_links):
        arm = starts[link] + along[link] / 2 - starts[: link + 1]  # from each joint to the middle of the link
        velocity = np.zeros((2, n_links))
        velocity[:, : link + 1] = np.column_stack([-arm[:, 1], arm[:, 0]]).T
        rotation = np.where(np.arange(n_links) <= link, 1.0, 0.0)
        weight = robot.masses[link]
        mass += weight * velocity.T @ velocity + weight * robot.lengths[link] ** 2 / 12 * np.outer(rotation, rotation)
        outer = np.maximum.outer(np.arange(link + 1), np.arange(link + 1))  # the outer joint of each pair
        stiffness[: link + 1, : link + 1] -= gravity * weight * arm[outer, 1]
    return mass, stiffness


def tip_jacobian(robot: PlanarRobot, angles: Real) -> Real:
    """Compute the derivative of reach, height and rotation of the tip over the joint rotations, (3, n_links)."""
    arm = np.cumsum(robot.link_vectors(angles)[::-1], axis=0)[::-1]
    return np.vstack([-arm[:, 1], arm[:, 0], np.ones(len(arm))])


def planar_compliance(robot: PlanarRobot, angles: Real) -> Real:
    """Compute the compliance ``J K^-1 J^T`` over reach, height and rotation of the tip, shape (3, 3)."""
    tip = tip_jacobian(robot, angles)
    return np.asarray((tip / np.asarray(robot.stiffness, dtype=float)) @ tip.T)


def planar_sag(robot: PlanarRobot, angles: Real) -> Real:
    """Compute the deflection of the tip under the weight of the links, (3,): ``J K^-1 tau``, ``tau = -dV/dtheta``."""
    along = robot.link_vectors(angles)[:, 0]
    middles = np.cumsum(along) - along / 2
    starts = np.cumsum(along) - along
    levers = np.array([np.sum(robot.masses[i:] * (middles[i:] - starts[i])) for i in range(len(along))])
    torques = -STANDARD_GRAVITY * levers
    return np.asarray(tip_jacobian(robot, angles) @ (torques / np.asarray(robot.stiffness, dtype=float)))


def rigid_model(robot: PlanarRobot, angles: Real, gravity: float = 0.0) -> ModalModel:
    """Compute the modal model at the tip of a robot with rigid links; its damping ratios go to rising modes in order.

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
