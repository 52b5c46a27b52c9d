"""Elastic parameters that deflections can identify: stiffnesses of joints, sections of links."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from millfrf.core import Real

from ..finite_elements.beam_element import Section, beam_stiffness
from ..finite_elements.structure import Spring, Structure, six_by_six
from ..kinematics.mechanism import drive_direction
from ..spatial.spatial_robot import SpatialRobot

GROUPS = {"radial": (0, 1), "axial": (2,), "tilting": (3, 4), "turning": (5,)}
"""Stiffnesses of a joint and their places in ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``."""

_STEP = 1e-4
"""Relative step of the differences of an element's closed form: their error is of the order of its square."""


class ElasticParameter(Protocol):
    """One positive number of a robot's elasticity."""

    def name(self, robot: SpatialRobot) -> str:
        """Name in words, as in messages: ``joint 2 turning``."""

    def value(self, robot: SpatialRobot) -> float:
        """Value that the robot has, in SI units."""

    def changed(self, robot: SpatialRobot, value: float) -> SpatialRobot:
        """Give the robot with another value."""

    def bounds(self, robot: SpatialRobot) -> tuple[float, float]:
        """Lowest and highest value that an identification may give."""

    def slope(self, robot: SpatialRobot, structure: Structure, motion: Real) -> Real:
        """``dC / d ln p`` at the tip, (6, 6), from all nodes' motion for unit loads there, (n_nodes, 6, 6)."""


@dataclass(frozen=True)
class JointStiffness:
    """Stiffness of one joint in one of ``GROUPS``, N/m or N m/rad; ``joint`` is its place in ``robot.joints``."""

    joint: int
    group: str

    def name(self, robot: SpatialRobot) -> str:
        """Name of the joint's frame and of the group, as in ``joint 2 turning``."""
        return f"joint {robot.joints[self.joint].frame} {self.group}"

    def value(self, robot: SpatialRobot) -> float:
        """Stiffness that the robot has."""
        return float(robot.joints[self.joint].stiffness[GROUPS[self.group][0]])

    def changed(self, robot: SpatialRobot, value: float) -> SpatialRobot:
        """Give the robot with another stiffness of this joint."""
        joint = robot.joints[self.joint]
        stiffness = joint.stiffness.copy()
        stiffness[list(GROUPS[self.group])] = value
        joints = (*robot.joints[: self.joint], replace(joint, stiffness=stiffness), *robot.joints[self.joint + 1 :])
        return replace(robot, joints=joints)

    def bounds(self, robot: SpatialRobot) -> tuple[float, float]:
        """1e3 to 1e12, the same for every joint."""
        return 1e3, 1e12

    def slope(self, robot: SpatialRobot, structure: Structure, motion: Real) -> Real:
        """``-sum_c k_c r_c^T r_c`` with r_c the joint's relative displacement for unit loads at the tip."""
        rows = list(GROUPS[self.group])
        relative = _relative(structure.springs[self.joint], structure.positions, motion)[rows]
        return -(relative.T * robot.joints[self.joint].stiffness[rows]) @ relative


@dataclass(frozen=True)
class LinkSection:
    """Bending stiffness E I (with the torsion tied to it) or axial stiffness E A (with the shear) of one flexible link.

    A round tube has ``J = 2 I``, so one number gives bending and torsion (Belchior et al. 2013, Table 2: quadratic and
    polar moments). Its mass is left as it is: deflections do not see it.

    Parameters
    ----------
    link
        Place in ``robot.links``.
    part
        ``bending``, N m^2, or ``axial``, N.
    """

    link: int
    part: str

    def name(self, robot: SpatialRobot) -> str:
        """Nodes of the link and the part, as in ``link 12-13 bending``."""
        first, second = robot.links[self.link].nodes
        return f"link {first}-{second} {self.part}"

    def value(self, robot: SpatialRobot) -> float:
        """E I, N m^2, or E A, N."""
        section = self._section(robot)
        return section.bending_z if self.part == "bending" else section.axial

    def changed(self, robot: SpatialRobot, value: float) -> SpatialRobot:
        """Give the robot with another section of this link."""
        link = robot.links[self.link]
        scaled = self._scaled(self._section(robot), value / self.value(robot))
        links = (*robot.links[: self.link], replace(link, section=scaled), *robot.links[self.link + 1 :])
        return replace(robot, links=links)

    def bounds(self, robot: SpatialRobot) -> tuple[float, float]:
        """A hundredth and a hundred times what the robot has."""
        return self.value(robot) / 100, self.value(robot) * 100

    def slope(self, robot: SpatialRobot, structure: Structure, motion: Real) -> Real:
        """``-u^T (dK / d ln p) u`` over the link's elements, u (12, 6) their ends' motion for unit loads at the tip."""
        section, whole = self._section(robot), np.zeros((6, 6))
        more, less = (self._scaled(section, factor) for factor in (1 + _STEP, 1 - _STEP))
        for beam in structure.beams:
            if beam.section == section and self._holds(robot, beam.nodes):
                first, second = beam.nodes
                length = float(np.linalg.norm(structure.positions[second] - structure.positions[first]))
                change = (beam_stiffness(more, length) - beam_stiffness(less, length)) / (2 * _STEP)
                turn = six_by_six(beam.axes).T
                ends = np.vstack([turn @ motion[first], turn @ motion[second]])
                whole -= ends.T @ change @ ends
        return whole

    def _holds(self, robot: SpatialRobot, nodes: tuple[int, int]) -> bool:
        """Whether an element is one of this link's: inner nodes are numbered link by link behind the robot's own."""
        start = robot.n_nodes + sum(link.elements - 1 for link in robot.links[: self.link] if link.section is not None)
        link = robot.links[self.link]
        chain = [link.nodes[0], *range(start, start + link.elements - 1), link.nodes[1]]
        return nodes in pairwise(chain)

    def _section(self, robot: SpatialRobot) -> Section:
        section = robot.links[self.link].section
        assert section is not None
        return section

    def _scaled(self, section: Section, factor: float) -> Section:
        if self.part == "bending":
            return replace(
                section,
                bending_y=factor * section.bending_y,
                bending_z=factor * section.bending_z,
                torsion=factor * section.torsion,
            )
        return replace(
            section,
            axial=factor * section.axial,
            shear_y=factor * section.shear_y,
            shear_z=factor * section.shear_z,
        )


def joint_parameters(robot: SpatialRobot) -> tuple[JointStiffness, ...]:
    """List all finite stiffnesses of joints but the own motion of passive joints, which is near free."""
    free = {
        frame.name: "axial" if drive_direction(frame) == GROUPS["axial"][0] else "turning"
        for frame in robot.mechanism.frames
        if not frame.active
    }
    return tuple(
        JointStiffness(index, group)
        for index, joint in enumerate(robot.joints)
        for group, places in GROUPS.items()
        if np.isfinite(joint.stiffness[places[0]]) and free.get(joint.frame) != group
    )


def link_parameters(robot: SpatialRobot) -> tuple[LinkSection, ...]:
    """List bending and axial stiffness of every flexible link."""
    return tuple(
        LinkSection(index, part)
        for index, link in enumerate(robot.links)
        if link.section is not None
        for part in ("bending", "axial")
    )


def _relative(spring: Spring, positions: Real, motion: Real) -> Real:
    """The joint's relative displacement for unit loads at the tip, in its axes, shape (6, 6)."""
    before, after = spring.motions(positions)
    return np.asarray(after @ motion[spring.nodes[1]] - before @ motion[spring.nodes[0]])
