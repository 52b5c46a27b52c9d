"""Tables that robot files of kind `serial` and `spatial` share, and the robots that are built from them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from millfrf.core import InputError, Real

from ..finite_elements.structure import rayleigh_constants
from ..kinematics.mechanism import named_values
from ..model_updating.bands import RobotUncertainty
from ..model_updating.changed_structure import UpdateParameter, changed_by
from ..serial_chains.serial_chain import inertia_fault, symmetric
from ..settings import ROBOT
from ..spatial.spatial_robot import SpatialRobot, check_tip
from .robot_files import SpatialHeadTable, Table

Vector = tuple[float, float, float]
Pair = tuple[float, float]


class DampingTable(Table):
    """Either two ratios at two frequencies (Rayleigh), or one ratio for all modes.

    Parameters
    ----------
    frequencies_hz : Hz
        Two frequencies at which the ``ratios`` hold (Rayleigh).
    ratios
        Damping ratios there, 0 to below 1; 4 % is 0.04.
    ratio
        One damping ratio for all modes, instead; 4 % is 0.04.
    """

    frequencies_hz: Pair | None = None
    ratios: Pair | None = None
    ratio: float | None = Field(None, ge=0, lt=1)

    def rayleigh(self) -> Pair:
        """Compute Rayleigh's constants, 1/s and s; zero if a single ratio is given."""
        if self.ratio is not None:
            if self.ratios is not None or self.frequencies_hz is not None:
                raise InputError("damping: give one ratio, or frequencies_hz and ratios (two each), not both")
            return (0.0, 0.0)
        if self.frequencies_hz is None or self.ratios is None:
            raise InputError("damping: give frequencies_hz and ratios (two each), or one ratio")
        if not all(0 <= ratio < 1 for ratio in self.ratios):
            raise InputError(f"damping: ratios = {list(self.ratios)} must be 0 or more and below 1; 4 % is 0.04")
        return rayleigh_constants(self.frequencies_hz, self.ratios)


class PoseRow(Table):
    """A posture: ``driven`` in degrees, of prismatic joints in metres; ``driven_deg`` is its older name.

    Parameters
    ----------
    name
        Name of the posture.
    driven : deg; prismatic joints m
        Values of the driven joints in the order of the frames.
    driven_deg : deg; prismatic joints m
        Older name of ``driven``: prismatic joints are in metres here too.
    """

    name: str
    driven: list[float] | None = None
    driven_deg: list[float] | None = None

    def values(self) -> list[float]:
        """Return the joint values from ``driven`` or from its older name ``driven_deg``."""
        values = [values for values in (self.driven, self.driven_deg) if values is not None]
        if len(values) != 1:
            raise InputError(f"posture {self.name!r}: give driven = [...] once: degrees, prismatic joints in metres")
        return values[0]


class LimitKeys(Table):
    """Limits of a joint.

    Parameters
    ----------
    limits_deg : deg
        Least and largest angle of a revolute joint; left out: none.
    limits_m : m
        Least and largest travel of a prismatic joint; left out: none.
    """

    limits_deg: Pair | None = None
    limits_m: Pair | None = None

    def limits(self, joint: str, motion: str) -> Pair:
        """Return the limits in rad or m; messages name the row by ``joint``."""
        sliding = motion == "prismatic"
        limits, other = (self.limits_m, self.limits_deg) if sliding else (self.limits_deg, self.limits_m)
        if other is not None or (limits is not None and motion == "fixed"):
            remedy = "leave its limits out" if motion == "fixed" else f"give {'limits_m' if sliding else 'limits_deg'}"
            raise InputError(f"{joint}: limits {list(other or limits or ())} of a {motion} joint; {remedy}")
        if limits is None:
            return -inf, inf
        if not sliding:
            return radians(limits[0]), radians(limits[1])
        if max(map(abs, limits)) > ROBOT.largest_travel:
            raise InputError(f"{joint}: limits_m = {list(limits)}: give metres, at most {ROBOT.largest_travel:g}")
        return limits


class BearingKeys(Table):
    """Stiffness of a joint; a direction without stiffness is rigid.

    Parameters
    ----------
    radial_n_per_m : N/m
        Stiffness of the bearing across the joint's axis; left out: rigid.
    axial_n_per_m : N/m
        Stiffness of the bearing along the joint's axis; left out: rigid.
    tilting_nm_per_rad : N m/rad
        Stiffness of the bearing against tilting of the axis; left out: rigid.
    turning_nm_per_rad : N m/rad
        Stiffness about the axis: the gear of a revolute joint; left out: rigid.
    """

    radial_n_per_m: float | None = Field(None, gt=0)
    axial_n_per_m: float | None = Field(None, gt=0)
    tilting_nm_per_rad: float | None = Field(None, gt=0)
    turning_nm_per_rad: float | None = Field(None, gt=0)

    def stiffness(self) -> Real:
        """Return the stiffnesses ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``, N/m and N m/rad."""
        radial, axial, tilting, turning = (
            inf if value is None else value
            for value in (self.radial_n_per_m, self.axial_n_per_m, self.tilting_nm_per_rad, self.turning_nm_per_rad)
        )
        return np.array([radial, radial, axial, tilting, tilting, turning])


class InertiaKeys(Table):
    """Centre of mass and inertia of a rigid body.

    Parameters
    ----------
    centre_m : m
        Centre of mass from the node or joint that carries the body.
    inertia_kg_m2 : kg m^2
        Inertia about the centre of mass: ``xx yy zz``, or ``xx yy zz xy xz yz`` with the signs of the matrix's entries.
    """

    centre_m: Vector = (0.0, 0.0, 0.0)
    inertia_kg_m2: Vector | tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0)

    def inertia(self, body: str) -> Real:
        """Inertia matrix (3, 3); an error names the ``body`` if no rigid body can have it."""
        inertia = symmetric(self.inertia_kg_m2)
        fault = inertia_fault(inertia)
        if fault is not None:
            raise InputError(f"{body}: inertia_kg_m2 = {list(self.inertia_kg_m2)}: {fault}")
        return inertia


class UpdatedNumber(Table):
    """A number that was freed; one that is not ``in_file`` has no key of its own there and is applied on reading.

    Parameters
    ----------
    name
        Name of the number.
    kind
        What it is: ``stiffness``, ``joint damping``, ``damping``, ``links``, ``inertia``, ``body``, ``payload``,
        ``tool mass``, ``sprung mass``, ``tool`` or ``base``.
    unit
        Unit of spread, value and standard error; empty: they are natural logarithms of a factor on the file's number
        (stiffness, links, damping, inertia), or ratios.
    frame
        Joint of a stiffness or of a joint's damping.
    group
        Directions of that joint, such as its gear or its bearing; empty for the others.
    axis
        Direction of a payload's place, 0 to 2, and 3 for its mass; of a tool or base 0 or 1.
    spread
        Standard deviation of the prior before the measurements, in ``unit``.
    value
        Change that was found, in ``unit``; if the unit is empty, 0.1 is a factor of 1.105.
    standard_error
        Standard error of ``value``, in ``unit``.
    told
        Whether the measurements determine it.
    in_file
        Whether the file has a key of its own for it.
    """

    name: str
    kind: str
    unit: str = ""
    frame: str = ""
    group: str = ""
    axis: int = 0
    spread: float
    value: float
    standard_error: float = 0.0
    told: bool = True
    in_file: bool = True

    def parameter(self) -> UpdateParameter:
        """Return the number as a parameter of an update."""
        return UpdateParameter(self.name, self.kind, self.unit, self.spread, self.frame, self.group, self.axis)


class UpdateTable(Table):
    """Verdict, names, numbers and their covariance.

    Parameters
    ----------
    verdict
        Verdict of the update.
    named
        Numbers that were certainly wrong in the file before.
    covariance
        Covariance of the numbers, row by row.
    numbers
        Numbers that were freed, ``[[update.numbers]]``.
    """

    verdict: str
    named: list[str]
    covariance: list[list[float]]
    numbers: list[UpdatedNumber]

    def uncertainty(self) -> RobotUncertainty:
        """Return the updated numbers and their covariance."""
        values = np.array([row.value for row in self.numbers])
        parameters = tuple(row.parameter() for row in self.numbers)
        return RobotUncertainty(parameters, values, np.array(self.covariance, ndmin=2))

    def warnings(self) -> tuple[str, ...]:
        """Return one warning about joint stiffnesses that the measurements did not determine, or no warning."""
        stiffnesses = [row for row in self.numbers if row.kind == "stiffness" and not row.told]
        if not stiffnesses:
            return ()
        joints = dict.fromkeys(row.name.removesuffix(" stiffness") for row in stiffnesses)
        return (
            f"the update's measurements do not determine the stiffness of {', '.join(joints)}: it is the file's own, "
            "and only as good as that",
        )

    def applied_to(self, robot: SpatialRobot) -> SpatialRobot:
        """Apply the numbers for which the file has no key (payload, tool, compliant base) to a robot."""
        late = [row for row in self.numbers if not row.in_file]
        values: Real = np.array([row.value for row in late])
        return changed_by(robot, tuple(row.parameter() for row in late), values) if late else robot


@dataclass(frozen=True)
class SpatialCase:
    """A robot in space as its file describes it.

    Parameters
    ----------
    name
        Name of the robot.
    robot
        The robot as a structure and mechanism.
    poses
        Driven joint values by name, rad and (prismatic joints) m.
    repeatability : m
        Pose repeatability after ISO 9283 (RP: radius of the sphere); None: the file does not give it.
    assumed
        Warnings of every result, one sentence each: assumed numbers that results depend on.
    uncertainty
        Numbers that an update changed, with their covariance; None: the file was never updated.
    """

    name: str
    robot: SpatialRobot
    poses: dict[str, NDArray[np.float64]]
    repeatability: float | None = None
    assumed: tuple[str, ...] = ()
    uncertainty: RobotUncertainty | None = None


def damping_and_gravity(robot: SpatialHeadTable, damping: DampingTable | None) -> dict[str, Any]:
    """Return the keyword arguments of `SpatialRobot` for damping and gravity."""
    length = hypot(*robot.up)
    if not length > 0:
        raise InputError(
            f"up = {list(robot.up)} has no direction; give the base frame's axis against weight: [0, 0, 1]"
        )
    return {
        "rayleigh": (0.0, 0.0) if damping is None else damping.rayleigh(),
        "damping_ratio": None if damping is None else damping.ratio,
        "gravity": robot.gravity_m_per_s2,
        "up": tuple(component / length for component in robot.up),
    }


def spatial_case(
    head: SpatialHeadTable,
    robot: SpatialRobot,
    poses: Sequence[PoseRow],
    update: UpdateTable | None,
    assumed: tuple[str, ...],
) -> SpatialCase:
    """Check the tool tip and the postures of a robot, and collect what its file says."""
    check_tip(robot)
    postures = named_values(robot.mechanism, [(pose.name, pose.values()) for pose in poses])
    uncertainty = None if update is None else update.uncertainty()
    return SpatialCase(head.name, robot, postures, head.repeatability_m, assumed, uncertainty)
