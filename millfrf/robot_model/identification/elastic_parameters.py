"""Elastic parameters that deflections can identify: stiffnesses of joints, sections of links."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from millfrf.core import Real

from ..finite_elements.beam_element import Section, beam_stiffness
from ..finite_elements.structure import Structure, six_by_six
from ..kinematics.mechanism import drive_direction
from ..spatial.spatial_robot import SpatialRobot

# stiffnesses of a joint and their places in (K_r, K_r, K_a, K_rr, K_rr, K_ar)
GROUPS = {"radial": (0, 1), "axial": (2,), "tilting": (3, 4), "turning": (5,)}


@dataclass(frozen=True)
class JointStiffness:
    """Stiffness of one joint in one group of directions, N/m or N m/rad.

    Parameters
    ----------
    joint
        Index of the joint in ``robot.joints``.
    group
        Group of directions: ``radial``, ``axial``, ``tilting`` or ``turning``.
    """

    joint: int
    group: str

    def name(self, robot: SpatialRobot) -> str:
        """Return the name of the joint's frame and of the group, such as ``joint 2 turning``."""
        return f"joint {robot.joints[self.joint].frame} {self.group}"

    def value(self, robot: SpatialRobot) -> float:
        """Return the present stiffness of the robot, N/m or N m/rad."""
        return float(robot.joints[self.joint].stiffness[GROUPS[self.group][0]])

    def changed(self, robot: SpatialRobot, value: float) -> SpatialRobot:
        """Return the robot with another stiffness of this joint."""
        stiffness = np.array([joint.stiffness for joint in robot.joints])
        stiffness[self.joint, list(GROUPS[self.group])] = value
        return robot.with_stiffness(stiffness)

    def bounds(self, robot: SpatialRobot) -> tuple[float, float]:
        """Return the lowest and highest stiffness that an identification may find, equal for all joints."""
        return 1e3, 1e12

    def slope(self, robot: SpatialRobot, structure: Structure, motion: Real) -> Real:
        """Return ``dC / d ln k = -sum_c k_c r_c^T r_c`` at the tip, (6, 6).

        ``motion`` (n_nodes, 6, 6) is the motion of all nodes for unit loads at the tip, and r_c the relative
        displacement in the joint.
        """
        rows, spring = list(GROUPS[self.group]), structure.springs[self.joint]
        before, after = spring.motions(structure.positions)
        relative = np.asarray(after @ motion[spring.nodes[1]] - before @ motion[spring.nodes[0]])[rows]
        return np.asarray(-(relative.T * robot.joints[self.joint].stiffness[rows]) @ relative)


@dataclass(frozen=True)
class LinkSection:
    """Bending stiffness E I (with the torsion tied to it) or axial stiffness E A (with the shear) of one flexible link.

    A round tube has ``J = 2 I``, so that one number gives bending and torsion (Belchior et al. 2013, Table 2: quadratic
    and polar moments). The link's mass stays, because deflections do not depend on it.

    Parameters
    ----------
    link
        Index of the link in ``robot.links``.
    part
        Either ``bending``, N m^2, or ``axial``, N.
    """

    link: int
    part: str

    def name(self, robot: SpatialRobot) -> str:
        """Return the nodes of the link and the part, such as ``link 12-13 bending``."""
        first, second = robot.links[self.link].nodes
        return f"link {first}-{second} {self.part}"

    def value(self, robot: SpatialRobot) -> float:
        """Return the present stiffness of the robot: E I, N m^2, or E A, N."""
        section = self._section(robot)
        return section.bending_z if self.part == "bending" else section.axial

    def changed(self, robot: SpatialRobot, value: float) -> SpatialRobot:
        """Return the robot with another section of this link."""
        links = list(robot.links)
        scaled = self._scaled(self._section(robot), value / self.value(robot))
        links[self.link] = replace(links[self.link], section=scaled)
        return replace(robot, links=tuple(links))

    def bounds(self, robot: SpatialRobot) -> tuple[float, float]:
        """Return the lowest and highest value that an identification may find: 0.01 and 100 times the present value."""
        return self.value(robot) / 100, self.value(robot) * 100

    def slope(self, robot: SpatialRobot, structure: Structure, motion: Real) -> Real:
        """Return ``dC / d ln p = -u^T (dK / d ln p) u`` at the tip, (6, 6), summed over the link's elements.

        u (12, 6) is the motion of an element's ends, out of ``motion`` (n_nodes, 6, 6) of all nodes for unit loads at
        the tip.
        """
        section, total = self._section(robot), np.zeros((6, 6))
        step = 1e-4  # central difference of the element's closed form: the relative error is about its square
        more, less = (self._scaled(section, factor) for factor in (1 + step, 1 - step))
        for beam in structure.beams:
            if beam.section == section and self._contains(robot, beam.nodes):
                first, second = beam.nodes
                length = float(np.linalg.norm(structure.positions[second] - structure.positions[first]))
                change = (beam_stiffness(more, length) - beam_stiffness(less, length)) / (2 * step)
                turn = six_by_six(beam.axes).T
                ends = np.vstack([turn @ motion[first], turn @ motion[second]])
                total -= ends.T @ change @ ends
        return total

    def _contains(self, robot: SpatialRobot, nodes: tuple[int, int]) -> bool:
        # inner nodes are numbered link by link after the robot's own nodes
        start = robot.n_nodes + sum(link.elements - 1 for link in robot.links[: self.link] if link.section is not None)
        link = robot.links[self.link]
        return nodes in pairwise([link.nodes[0], *range(start, start + link.elements - 1), link.nodes[1]])

    def _section(self, robot: SpatialRobot) -> Section:
        section = robot.links[self.link].section
        assert section is not None
        return section

    def _scaled(self, section: Section, factor: float) -> Section:
        names = ("bending_y", "bending_z", "torsion") if self.part == "bending" else ("axial", "shear_y", "shear_z")
        return replace(section, **{name: factor * getattr(section, name) for name in names})


ElasticParameter = JointStiffness | LinkSection


def joint_parameters(robot: SpatialRobot) -> tuple[JointStiffness, ...]:
    """List all finite joint stiffnesses, except in the direction of motion of passive joints, which are nearly free.

    Parameters
    ----------
    robot
        Robot whose joints are identified.
    """
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
    """List bending and axial stiffness of every flexible link.

    Parameters
    ----------
    robot
        Robot whose links are identified.
    """
    return tuple(
        LinkSection(index, part)
        for index, link in enumerate(robot.links)
        if link.section is not None
        for part in ("bending", "axial")
    )
