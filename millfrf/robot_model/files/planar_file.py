"""Planar robots from their files."""

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import InputError

from ..finite_elements.beam_element import Section
from ..kinematics.joint_values import named_values
from ..kinematics.mechanism import Frame, Mechanism
from ..planar import PlanarRobot
from .robot_files import Table, read_as


class _Head(Table):
    """The table ``[robot]``.

    Parameters
    ----------
    name
        Name of the robot.
    kind
        ``serial``, ``spatial`` or ``planar``: which tables the file has.
    """

    name: str
    kind: str


class _Section(Table):
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


class _Link(Table):
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
        Damping ratio of the mode of this number where links are rigid; its double is the loss factor of link and
        joint where they are flexible.
    section
        Section of the beam.
    """

    length_m: float = Field(gt=0)
    mass_kg: float = Field(gt=0)
    joint_stiffness_nm_per_rad: float = Field(gt=0)
    damping_ratio: float = Field(ge=0, lt=1)
    section: _Section


class _Pose(Table):
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
        The robot as a whole.
    links
        Links from the base to the tip.
    poses
        Named postures; the first is the default.
    """

    model_config = ConfigDict(extra="forbid")

    robot: _Head
    links: list[_Link] = Field(min_length=1)
    poses: list[_Pose] = []


@dataclass(frozen=True)
class PlanarCase:
    """A planar robot with the postures at which it was published.

    Parameters
    ----------
    robot
        The robot, with sections of its links.
    poses : rad
        Joint angles by name of the pose.
    measured, predicted : Hz
        First natural frequency by name of the pose, where the source gives one.
    """

    robot: PlanarRobot
    poses: dict[str, NDArray[np.float64]]
    measured: dict[str, float]
    predicted: dict[str, float]

    @property
    def mechanism(self) -> Mechanism:
        """The chain's joints 1, 2, ... as revolute frames, for the names and units of joint values."""
        names = [str(number + 1) for number in range(len(self.robot.lengths))]
        frames = tuple(Frame(name, before) for name, before in zip(names, ["0", *names[:-1]], strict=True))
        return Mechanism(frames, names[-1])


def read_planar_robot(robot: str | os.PathLike[str]) -> PlanarCase:
    """Read a robot of kind ``planar``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or a posture with values that no joint has.
    FileFormatError
        Not a planar robot, or a key unknown, missing or of the wrong type.
    """
    content = read_as(PlanarFile, robot, "planar")
    links = content.links
    sections = tuple(
        Section(
            axial=link.section.axial_n,
            bending_y=link.section.bending_nm2,
            bending_z=link.section.bending_nm2,
            torsion=link.section.bending_nm2,
            mass=link.mass_kg / link.length_m,
            shear_y=link.section.shear_n,
            shear_z=link.section.shear_n,
        )
        for link in links
    )
    chain = PlanarRobot(
        np.array([link.length_m for link in links]),
        np.array([link.mass_kg for link in links]),
        np.array([link.joint_stiffness_nm_per_rad for link in links]),
        np.array([link.damping_ratio for link in links]),
        sections,
    )
    measured = {pose.name: pose.measured_first_mode_hz for pose in content.poses}
    predicted = {pose.name: pose.predicted_first_mode_hz for pose in content.poses}
    case = PlanarCase(chain, {}, _given(measured), _given(predicted))
    try:
        return replace(
            case, poses=named_values(case.mechanism, [(pose.name, pose.angles_deg) for pose in content.poses])
        )
    except InputError as error:
        raise InputError(f"{robot}: {error}") from error


def _given(values: dict[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in values.items() if value is not None}
