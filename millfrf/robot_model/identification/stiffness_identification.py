"""Elastic parameters of a robot from measured deflections (Belchior et al. 2013, 4.2), checked on held-out postures."""

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real, apart

from ..finite_elements.statics import constrained_system
from ..finite_elements.structure import rigid_motion
from ..kinematics.mechanism import Mechanism, close_loops, driven_values, joint_unit
from ..settings import IDENTIFICATION
from ..spatial.spatial_robot import SpatialRobot, structure_at
from .elastic_parameters import ElasticParameter, joint_parameters
from .parameter_search import Identification, identify


@dataclass(frozen=True)
class Deflection:
    """One measured deflection under one load.

    Parameters
    ----------
    q : (n_moving,), rad or m
        Joint values of the posture, loops closed.
    wrench : (6,), N and N m
        Change of force and moment at the tool tip, base frame.
    displacement : (3,), m
        Change of place of the target, base frame.
    target : (3,), m
        Place of the target (a tracker's reflector) from the tip, base frame.
    """

    q: Real
    wrench: Real
    displacement: Real
    target: Real = field(default_factory=lambda: np.zeros(3))


def stiffness_names(robot: SpatialRobot) -> tuple[str, ...]:
    """List the names of all finite joint stiffnesses, such as ``joint 1 radial``; see :func:`joint_parameters`.

    Parameters
    ----------
    robot
        Robot whose joints are identified.

    Examples
    --------
    >>> from millfrf.robot_model import read_spatial_robot
    >>> len(stiffness_names(read_spatial_robot("fanuc_s420if").robot))
    33
    """
    return tuple(parameter.name(robot) for parameter in joint_parameters(robot))


def identify_joint_stiffness(
    robot: SpatialRobot, measured: Sequence[Deflection], error: float, *, prior: float = 1.0
) -> Identification:
    """Identify the joint stiffnesses alone, with the parameters of :func:`identify_elastic`."""
    return identify_elastic(robot, measured, error, joint_parameters(robot), prior=prior)


def identify_elastic(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    parameters: Sequence[ElasticParameter],
    *,
    prior: float = 1.0,
) -> Identification:
    """Identify the elastic parameters for which the model's deflections are nearest to the measured ones.

    ``min sum |delta(p) - delta_measured|^2 / error^2`` over the logarithms (Belchior et al. 2013, Eqs. 26-27; they
    search with a genetic algorithm). The derivative of the compliance at the tool is ``-u^T (dK / d ln p) u`` with u
    the motion of all nodes for unit loads at the tool.

    Parameters
    ----------
    robot
        Robot whose numbers are the start.
    measured
        Deflections at several postures and loads.
    error : m
        Standard error of a measured displacement.
    parameters
        Parameters to identify: :func:`millfrf.robot_model.joint_parameters`,
        :func:`millfrf.robot_model.link_parameters`, or both.
    prior
        Prior standard deviation of ln p: how well the start is known; 1.0: within a factor e.

    Raises
    ------
    InputError
        No measurements or parameters, or an error that is not positive.
    """
    if not measured or not error > 0:
        raise InputError(f"{len(measured)} deflections with standard error {error!r} m; give both, positive")
    if not parameters:
        raise InputError("the robot has no finite stiffness to identify; give its joints stiffnesses to start from")
    problem = _Problem(robot, tuple(measured), error, tuple(parameters))
    names = [parameter.name(robot) for parameter in parameters]
    start = np.array([parameter.value(robot) for parameter in parameters])
    low, high = np.array([parameter.bounds(robot) for parameter in parameters]).T
    return identify(problem.residuals, names, low, high, start=start, jacobian=problem.jacobian, prior=prior)


def apply_joint_stiffness(robot: SpatialRobot, values: Real) -> SpatialRobot:
    """Return the robot with stiffnesses (n_parameters,) in the order of :func:`stiffness_names`."""
    return apply_elastic(robot, joint_parameters(robot), values)


def apply_elastic(robot: SpatialRobot, parameters: Sequence[ElasticParameter], values: Real) -> SpatialRobot:
    """Return the robot with other values of its elastic parameters.

    Parameters
    ----------
    robot
        Robot to change.
    parameters
        Parameters that are changed.
    values : (n_parameters,)
        New values of the parameters, in SI units.
    """
    for parameter, value in zip(parameters, values, strict=True):
        robot = parameter.changed(robot, float(value))
    return robot


def predicted_deflections(robot: SpatialRobot, measured: Sequence[Deflection]) -> Real:
    """Compute the modelled displacement of each target for the measured postures and wrenches, m, shape (n, 3).

    Parameters
    ----------
    robot
        Robot whose deflections are computed.
    measured
        Postures, wrenches and targets; the measured displacements are not used.
    """
    return _Problem(robot, tuple(measured), 1.0, ()).displacements(robot)


class _Problem:
    """Residuals and Jacobian of an identification.

    Each posture is factored once for all its loads. The result for the last parameter values is stored, because
    least_squares computes the Jacobian for the values for which it has just computed the residuals.
    """

    def __init__(
        self,
        robot: SpatialRobot,
        measured: tuple[Deflection, ...],
        error: float,
        parameters: tuple[ElasticParameter, ...],
    ) -> None:
        self.robot, self.error, self.parameters = robot, error, parameters
        keys = [np.asarray(case.q).tobytes() for case in measured]
        postures = dict(zip(keys, (case.q for case in measured), strict=True))
        self.postures = list(postures.values())
        self.posture_of = [list(postures).index(key) for key in keys]
        self.wrenches = np.array([case.wrench for case in measured])
        self.target_motion = np.array([rigid_motion(np.asarray(case.target))[:3] for case in measured])
        self.displaced = np.array([case.displacement for case in measured])
        self.key = b""
        self.known: tuple[Real, Real] = (np.zeros(0), np.zeros(0))

    def _at(self, values: Real) -> tuple[Real, Real]:
        if values.tobytes() != self.key:
            self.key = values.tobytes()
            self.known = self._compliance_and_slopes(apply_elastic(self.robot, self.parameters, values))
        return self.known

    def _compliance_and_slopes(self, robot: SpatialRobot) -> tuple[Real, Real]:
        """Compute each measurement's compliance (n, 6, 6) and derivatives over ln p (n, n_parameters, 6, 6)."""
        compliances, slopes = [], []
        for q in self.postures:
            structure = structure_at(robot, q)
            motion = np.vstack([np.zeros((6, 6)), constrained_system(structure).tip_responses()]).reshape(-1, 6, 6)
            compliances.append(motion[structure.tip])
            slopes.append([parameter.slope(robot, structure, motion) for parameter in self.parameters])
        return np.array(compliances)[self.posture_of], np.array(slopes)[self.posture_of]

    def displacements(self, robot: SpatialRobot) -> Real:
        """Compute the displacement of each target, (n, 3), m."""
        return self._moved(self._compliance_and_slopes(robot)[0])

    def residuals(self, values: Real) -> Real:
        """Compute the modelled minus the measured displacement, divided by the standard error, (3 n,)."""
        return np.asarray((self._moved(self._at(values)[0]) - self.displaced).ravel() / self.error)

    def jacobian(self, values: Real) -> Real:
        """Compute the derivative of the residuals over the logarithms of the parameters, (3 n, n_parameters)."""
        slopes = np.einsum("kia,kpab,kb->kip", self.target_motion, self._at(values)[1], self.wrenches, optimize=True)
        return np.asarray(slopes.reshape(-1, slopes.shape[-1]) / self.error)

    def _moved(self, compliance: Real) -> Real:
        return np.asarray(np.einsum("kia,kab,kb->ki", self.target_motion, compliance, self.wrenches, optimize=True))


LOADS = ("fx_n", "fy_n", "fz_n")
MOVED = ("dx_m", "dy_m", "dz_m")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
PLACES = ("target_x_m", "target_y_m", "target_z_m", "pull_x_m", "pull_y_m", "pull_z_m")
OPTIONAL = (*MOMENTS, *PLACES)  # left out: no moment, target and force at the tip


def deflection_columns(mechanism: Mechanism) -> tuple[str, ...]:
    """List the columns that a table of deflections must have: driven joints (``joint_1_deg`` ...), load, displacement.

    Examples
    --------
    >>> from millfrf.robot_model import Frame
    >>> rail = Mechanism((Frame("rail", "0", motion="prismatic"), Frame("1", "rail")), "1")
    >>> deflection_columns(rail)[:3]
    ('joint_rail_m', 'joint_1_deg', 'fx_n')
    """
    frames = [mechanism.frames[index] for index in mechanism.moving if mechanism.frames[index].active]
    return (*(f"joint_{frame.name}_{joint_unit(frame)}" for frame in frames), *LOADS, *MOVED)


def read_deflections(path: str | os.PathLike[str], mechanism: Mechanism) -> tuple[Deflection, ...]:
    """Read a table of deflections: joint values, change of load, and the change of the target's place.

    Force, moment and displacement are in the base frame. ``target_*`` and ``pull_*`` are the places of the target and
    of the force relative to the tip, in the tool frame. The moment of the force about the tip is added to the moment
    in the table.

    Parameters
    ----------
    path
        CSV with the columns of ``deflection_columns`` and, where they are known, ``mx_nm my_nm mz_nm``,
        ``target_x_m ...`` and ``pull_x_m ...``. Lines that begin with ``#`` are skipped.
    mechanism
        Mechanism of the robot that was measured.

    Raises
    ------
    InputError
        No such file, or joint values outside of the joint limits.
    FileFormatError
        A column missing or unknown, an entry that is no number, or a number that is too large for its unit.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the table as CSV in UTF-8") from error
    required, rows = deflection_columns(mechanism), list(csv.DictReader(apart(lines)[1], restkey="further"))
    if not rows:
        raise FileFormatError(f"{path} holds no deflections; give a line of headings and a row for each measurement")
    _check_columns(path, set(rows[0]), required)
    return tuple(_deflection(f"{path}: row {number}", row, mechanism) for number, row in enumerate(rows, 1))


def _check_columns(path: object, columns: set[str], required: tuple[str, ...]) -> None:
    missing = [name for name in required if name not in columns]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; deflections have {', '.join(required)}")
    unknown = sorted(str(name) for name in columns - {*required, *OPTIONAL})
    if unknown:
        raise FileFormatError(
            f"{path}: column {unknown[0]!r} is not known; the columns are {', '.join(required)} and, where needed, "
            f"{', '.join(OPTIONAL)}"
        )


def _deflection(where: str, row: dict[str, str], mechanism: Mechanism) -> Deflection:
    typed = [_number(where, name, row) for name in deflection_columns(mechanism)[:-6]]
    force, moment, moved, target, pull = (
        np.array([_number(where, name, row) for name in names])
        for names in (LOADS, MOMENTS, MOVED, PLACES[:3], PLACES[3:])
    )
    if not (np.any(force) or np.any(moment)):
        raise FileFormatError(f"{where} has no load; give the change of force that moved the target")
    try:
        q = close_loops(mechanism, driven_values(mechanism, typed))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    attitude = mechanism.transforms(q)[mechanism.index(mechanism.tool), :3, :3]
    # the force at its own point is moved to the tip, with its moment about the tip
    wrench = np.concatenate([force, moment + np.cross(attitude @ pull, force)])
    return Deflection(q, wrench, moved, np.asarray(attitude @ target))


def _number(where: str, name: str, row: dict[str, str]) -> float:
    """Read the number of one entry and check its range by the unit in the column's name; optional ones may be empty."""
    text = row.get(name)
    if name in OPTIONAL and not text:
        return 0.0
    try:
        value = float(text or "")
    except ValueError as error:
        raise FileFormatError(f"{where}: {name} = {text!r} is no number; give a number") from error
    if not np.isfinite(value):
        raise FileFormatError(f"{where}: {name} = {text!r} is not finite; leave the row out")
    if name.startswith("joint_"):
        return value
    largest = {"n": (2e4, "newtons"), "nm": (2e4, "newton metres"), "m": (0.05, "metres; 1 mm is 0.001")}
    limit, unit = (3.0, "metres from the tip") if name in PLACES else largest[name.split("_")[-1]]
    if abs(value) > limit:
        raise FileFormatError(f"{where}: {name} = {value:g} is larger than {limit:g}; give {unit}")
    return value


@dataclass(frozen=True)
class HeldOut:
    """Errors of predicted deflections at postures that were held out.

    Parameters
    ----------
    postures
        Number of postures that were held out.
    deflections : (n,), m
        Length of each measured deflection there.
    before, after : (n,), m
        Errors of the deflections that the start and the identified model predict.
    """

    postures: int
    deflections: Real
    before: Real
    after: Real

    def times(self, error: float) -> float:
        """Compute the identified model's root mean square error over the standard error of a displacement component."""
        return float(np.sqrt(np.mean(self.after**2) / 3) / error)


def verify_elastic(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    parameters: Sequence[ElasticParameter],
    *,
    prior: float = 1.0,
) -> HeldOut | None:
    """Identify from four fifths of the postures, and predict the deflections in the remaining fifth.

    All deflections of a posture are held out together (Belchior et al. 2013 hold out a second load). Return None for
    fewer than ten postures, which are too few to hold any out.

    Parameters
    ----------
    robot, measured, error, parameters, prior
        The same as in :func:`millfrf.robot_model.identify_elastic`.
    """
    # the deflections of a posture are not independent of each other, so that a posture is held out as a whole
    keys = [np.asarray(case.q).tobytes() for case in measured]
    distinct = list(dict.fromkeys(keys))
    if len(distinct) < IDENTIFICATION.fewest_postures:
        return None
    order = np.random.default_rng(0).permutation(len(distinct))
    held_out = {distinct[index] for index in order[:: IDENTIFICATION.held_out_every]}
    fitted_cases = [case for case, key in zip(measured, keys, strict=True) if key not in held_out]
    held_out_cases = [case for case, key in zip(measured, keys, strict=True) if key in held_out]
    identification = identify_elastic(robot, fitted_cases, error, parameters, prior=prior)
    displaced = np.array([case.displacement for case in held_out_cases])
    before, after = (
        np.linalg.norm(predicted_deflections(model, held_out_cases) - displaced, axis=1)
        for model in (robot, apply_elastic(robot, parameters, identification.values))
    )
    return HeldOut(len(held_out), np.linalg.norm(displaced, axis=1), before, after)
