"""Planar robots from their files."""

import os
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import Real

from ..finite_elements.beam_element import Section
from ..kinematics.mechanism import Frame, Mechanism, named_values
from ..planar import PlanarRobot
from .robot_files import HeadTable, Table, read_as


class SectionTable(Table):
    """The table ``[links.section]``: stiffness of a beam's section.

    Parameters
    ----------
    axial_n : N
        Young's modulus times area, E A.
    bending_nm2 : N m^2
        Young's modulus times second moment of area, E I.
    shear_n : N
        Shear modulus times effective area, k G A.
    """

    axial_n: float = Field(gt=0)
    bending_nm2: float = Field(gt=0)
    shear_n: float = Field(gt=0)


class PlanarLinkRow(Table):
    """A row ``[[links]]``: a link with the joint before it.

    Parameters
    ----------
    length_m : m
        Length of the link.
    mass_kg : kg
        Mass of the link, spread evenly.
    joint_stiffness_nm_per_rad : N m/rad
        Torsional stiffness of the joint before it.
    damping_ratio
        Damping ratio of the mode with the link's number if links are rigid; twice this ratio is the loss factor of
        link and joint if links are flexible.
    section
        Section of the beam.
    """

    length_m: float = Field(gt=0)
    mass_kg: float = Field(gt=0)
    joint_stiffness_nm_per_rad: float = Field(gt=0)
    damping_ratio: float = Field(ge=0, lt=1)
    section: SectionTable


class PlanarPose(Table):
    """A row ``[[poses]]``.

    Parameters
    ----------
    name
        Name of the posture.
    angles_deg : deg
        Joint angles, each from the link before.
    measured_first_mode_hz : Hz
        Lowest natural frequency as its source measured it; for comparison only.
    predicted_first_mode_hz : Hz
        Lowest natural frequency as its source computed it; for comparison only.
    """

    name: str
    angles_deg: list[float]
    measured_first_mode_hz: float | None = None
    predicted_first_mode_hz: float | None = None


class PlanarFile(BaseModel):
    """A robot file of kind ``planar``.

    Parameters
    ----------
    robot
        Name and kind of the robot.
    links
        Links from the base to the tip.
    poses
        Named postures; the first is the default.
    """

    model_config = ConfigDict(extra="forbid")

    robot: HeadTable
    links: list[PlanarLinkRow] = Field(min_length=1)
    poses: list[PlanarPose] = []


@dataclass(frozen=True)
class PlanarCase:
    """A planar robot with the postures at which it was published.

    Parameters
    ----------
    robot
        The robot with sections of its links.
    poses : rad
        Joint angles by name of the pose.
    measured, predicted : Hz
        First natural frequency by name of the pose, if the source gives one.
    """

    robot: PlanarRobot
    poses: dict[str, Real]
    measured: dict[str, float]
    predicted: dict[str, float]

    @property
    def mechanism(self) -> Mechanism:
        """The chain's joints 1, 2, ... as revolute frames, for the names and units of joint values."""
        return _mechanism(len(self.robot.lengths))


def _mechanism(n_links: int) -> Mechanism:
    names = [str(number + 1) for number in range(n_links)]
    return Mechanism(tuple(Frame(name, before) for name, before in zip(names, ["0", *names], strict=False)), names[-1])


def read_planar_robot(robot: str | os.PathLike[str]) -> PlanarCase:
    """Read a robot of kind ``planar``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or a posture with impossible joint values.
    FileFormatError
        Not a planar robot, or a key unknown, missing or of the wrong type.
    """
    return read_as(PlanarFile, robot, "planar", _case)


def _case(content: PlanarFile) -> PlanarCase:
    links = content.links
    chain = PlanarRobot(
        np.array([link.length_m for link in links]),
        np.array([link.mass_kg for link in links]),
        np.array([link.joint_stiffness_nm_per_rad for link in links]),
        np.array([link.damping_ratio for link in links]),
        tuple(_section(link) for link in links),
    )
    poses = named_values(_mechanism(len(links)), [(pose.name, pose.angles_deg) for pose in content.poses])
    measured = {p.name: p.measured_first_mode_hz for p in content.poses if p.measured_first_mode_hz is not None}
    predicted = {p.name: p.predicted_first_mode_hz for p in content.poses if p.predicted_first_mode_hz is not None}
    return PlanarCase(chain, poses, measured, predicted)


def _section(link: PlanarLinkRow) -> Section:
    # bending about y and torsion are not used in the plane; they must only be positive
    return Section(
        axial=link.section.axial_n,
        bending_y=link.section.bending_nm2,
        bending_z=link.section.bending_nm2,
        torsion=link.section.bending_nm2,
        mass=link.mass_kg / link.length_m,
        shear_y=link.section.shear_n,
        shear_z=link.section.shear_n,
    )
