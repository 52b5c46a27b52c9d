"""Elasticity of a robot from measured deflections (Belchior et al. 2013, 4.2), judged on held-out postures."""

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real, apart

from ..finite_elements.statics import constrained_system
from ..finite_elements.structure import rigid_motion
from ..kinematics.joint_values import driven_values, joint_unit
from ..kinematics.mechanism import Mechanism, close_loops
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
    """``joint 1 radial`` ... of all finite stiffnesses but the own motion of passive joints, which is near free.

    Examples
    --------
    >>> from millfrf.robot_model import read_spatial_robot
    >>> len(stiffness_names(read_spatial_robot("fanuc_s420if").robot))
    33
    """
    return tuple(parameter.name(robot) for parameter in joint_parameters(robot))


def identify_joint_stiffness(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    *,
    bounds: tuple[float, float] = (1e3, 1e12),
    prior: float = 1.0,
) -> Identification:
    """Find joint stiffnesses alone: see :func:`identify_elastic`; ``bounds``: the same for every joint, SI."""
    return identify_elastic(robot, measured, error, joint_parameters(robot), bounds=bounds, prior=prior)


def identify_elastic(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    parameters: Sequence[ElasticParameter],
    *,
    bounds: tuple[float, float] | None = None,
    prior: float = 1.0,
) -> Identification:
    """Find the elastic numbers that bring the model's deflections nearest to the measured ones.

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
        Numbers to find: :func:`millfrf.robot_model.joint_parameters`, :func:`millfrf.robot_model.link_parameters`, or
        both.
    bounds
        Lowest and highest value of all; None: each parameter's own.
    prior
        Standard deviation of ln p, which says how well the start is known; 1.0: within a factor e.

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
    low, high = np.array([bounds or parameter.bounds(robot) for parameter in parameters]).T
    return identify(problem.residuals, names, low, high, start=start, jacobian=problem.jacobian, prior=prior)


def apply_joint_stiffness(robot: SpatialRobot, values: Real) -> SpatialRobot:
    """The robot with stiffnesses in the order of :func:`stiffness_names`."""
    return apply_elastic(robot, joint_parameters(robot), values)


def apply_elastic(robot: SpatialRobot, parameters: Sequence[ElasticParameter], values: Real) -> SpatialRobot:
    """The robot with other values of its elastic parameters, (n_parameters,)."""
    for parameter, value in zip(parameters, values, strict=True):
        robot = parameter.changed(robot, float(value))
    return robot


def predicted_deflections(robot: SpatialRobot, measured: Sequence[Deflection]) -> Real:
    """Displacement of each target that the model gives for the same postures and wrenches, m, shape (n, 3)."""
    return _Problem(robot, tuple(measured), 1.0, ()).displacements(robot)


class _Problem:
    """Residuals and Jacobian share one factorisation a posture; the last trial is kept."""

    def __init__(
        self,
        robot: SpatialRobot,
        measured: tuple[Deflection, ...],
        error: float,
        parameters: tuple[ElasticParameter, ...],
    ) -> None:
        self.robot, self.error, self.parameters = robot, error, parameters
        places: dict[bytes, int] = {}
        self.owner = [places.setdefault(np.asarray(case.q).tobytes(), len(places)) for case in measured]
        first = {owner: case.q for case, owner in reversed(list(zip(measured, self.owner, strict=True)))}
        self.postures = [first[owner] for owner in range(len(places))]
        self.wrenches = np.array([case.wrench for case in measured])
        self.seen = np.array([rigid_motion(np.asarray(case.target))[:3] for case in measured])
        self.displaced = np.array([case.displacement for case in measured])
        self.key = b""
        self.known: tuple[Real, Real] = (np.zeros(0), np.zeros(0))

    def _at(self, values: Real) -> tuple[Real, Real]:
        if values.tobytes() != self.key:
            self.key = values.tobytes()
            self.known = self._compliance_and_slopes(apply_elastic(self.robot, self.parameters, values))
        return self.known

    def _compliance_and_slopes(self, robot: SpatialRobot) -> tuple[Real, Real]:
        """Compliance (n, 6, 6) and its derivatives over ln p (n, n_parameters, 6, 6), a row for each measurement."""
        compliances, slopes = [], []
        for q in self.postures:
            structure = structure_at(robot, q)
            motion = np.vstack([np.zeros((6, 6)), constrained_system(structure).tip_responses()]).reshape(-1, 6, 6)
            compliances.append(motion[structure.tip])
            slopes.append([parameter.slope(robot, structure, motion) for parameter in self.parameters])
        return np.array(compliances)[self.owner], np.array(slopes)[self.owner]

    def displacements(self, robot: SpatialRobot) -> Real:
        """Displacement of each target, (n, 3), m."""
        return self._moved(self._compliance_and_slopes(robot)[0])

    def residuals(self, values: Real) -> Real:
        """Computed less measured displacement over the error, (3 n,)."""
        return np.asarray((self._moved(self._at(values)[0]) - self.displaced).ravel() / self.error)

    def jacobian(self, values: Real) -> Real:
        """Their derivative over the logarithms of the parameters, (3 n, n_parameters)."""
        slopes = np.einsum("kia,kpab,kb->kip", self.seen, self._at(values)[1], self.wrenches, optimize=True)
        return np.asarray(slopes.reshape(-1, slopes.shape[-1]) / self.error)

    def _moved(self, compliance: Real) -> Real:
        return np.asarray(np.einsum("kia,kab,kb->ki", self.seen, compliance, self.wrenches, optimize=True))


LOADS = ("fx_n", "fy_n", "fz_n")
MOVED = ("dx_m", "dy_m", "dz_m")
MOMENTS = ("mx_nm", "my_nm", "mz_nm")
TARGET = ("target_x_m", "target_y_m", "target_z_m")
PULLED = ("pull_x_m", "pull_y_m", "pull_z_m")
"""The last three may be left out: no moment, target and force at the tip."""

_LARGEST = {"n": (2e4, "newtons"), "nm": (2e4, "newton metres"), "m": (0.05, "metres; 1 mm is 0.001")}
_FARTHEST = 3.0
"""Farthest place of a target or of a force from the tip, m."""


def deflection_columns(mechanism: Mechanism) -> tuple[str, ...]:
    """Names of the columns that a table of deflections must have: driven joints first, ``joint_1_deg`` ...

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
    """Read deflections: joint values, change of load, change of the target's place between both loads.

    Force, moment and displacement are in the base frame. ``target_*`` and ``pull_*`` are the places of the target and
    of the force from the tip, in the tool frame; a moment beside it is added as it is.

    Parameters
    ----------
    path
        CSV with the columns of ``deflection_columns`` and, where they are known, ``mx_nm my_nm mz_nm``,
        ``target_x_m ...`` and ``pull_x_m ...``. Lines that begin with ``#`` are passed over.
    mechanism
        Mechanism of the robot that was measured.

    Raises
    ------
    InputError
        No such file, or joint values that no joint has.
    FileFormatError
        A column missing or unknown, an entry that is no number, or numbers that their unit cannot mean.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the table as CSV in UTF-8") from error
    needed, rows = deflection_columns(mechanism), list(csv.DictReader(apart(lines)[1], restkey="further"))
    if not rows:
        raise FileFormatError(f"{path} holds no deflections; give a line of headings and a row for each measurement")
    _check_columns(path, set(rows[0]), needed)
    return tuple(_deflection(path, number, row, mechanism) for number, row in enumerate(rows, 1))


def _check_columns(path: object, given: set[str], needed: tuple[str, ...]) -> None:
    missing = [name for name in needed if name not in given]
    if missing:
        raise FileFormatError(f"{path} lacks the columns {', '.join(missing)}; deflections have {', '.join(needed)}")
    known = {*needed, *MOMENTS, *TARGET, *PULLED}
    unknown = sorted(str(name) for name in given - known)
    if unknown:
        raise FileFormatError(
            f"{path}: column {unknown[0]!r} is not known; beside {', '.join(needed)} there may be "
            f"{', '.join((*MOMENTS, *TARGET, *PULLED))}"
        )


def _deflection(path: object, number: int, row: dict[str, str], mechanism: Mechanism) -> Deflection:
    n_joints = len(deflection_columns(mechanism)) - 6
    where = f"{path}: row {number}"
    typed = [_number(where, name, row) for name in deflection_columns(mechanism)[:n_joints]]
    force, moment, moved, target, pulled = (
        np.array([_number(where, name, row) for name in names]) for names in (LOADS, MOMENTS, MOVED, TARGET, PULLED)
    )
    if not (np.any(force) or np.any(moment)):
        raise FileFormatError(f"{where} has no load; give the change of force that moved the target")
    try:
        q = close_loops(mechanism, driven_values(mechanism, typed))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    attitude = mechanism.transforms(q)[mechanism.index(mechanism.tool), :3, :3]
    wrench = np.concatenate([force, moment + np.cross(attitude @ pulled, force)])
    return Deflection(q, wrench, moved, np.asarray(attitude @ target))


def _number(where: str, name: str, row: dict[str, str]) -> float:
    """One entry, checked by the unit that its name ends on; an entry of an optional column may be empty."""
    text = row.get(name)
    optional = name in (*MOMENTS, *TARGET, *PULLED)
    if optional and not text:
        return 0.0
    try:
        value = float(text or "")
    except ValueError as error:
        raise FileFormatError(f"{where}: {name} = {text!r} is no number; give one") from error
    if not np.isfinite(value):
        raise FileFormatError(f"{where}: {name} = {text!r} is not finite; leave the row out")
    if name.startswith("joint_"):
        return value
    largest, unit = (_FARTHEST, "metres from the tip") if name in (*TARGET, *PULLED) else _LARGEST[name.split("_")[-1]]
    if abs(value) > largest:
        raise FileFormatError(f"{where}: {name} = {value:g} is larger than {largest:g}; give {unit}")
    return value


FEWEST = 10
"""Fewest postures of which some can be held out."""

_EVERY = 5


@dataclass(frozen=True)
class HeldOut:
    """Errors of predicted deflections at postures that were held out.

    Parameters
    ----------
    postures
        How many postures were held out.
    deflections, before, after : (n,), m
        Length of each measured deflection there, and of what the start and the identified model miss of it.
    """

    postures: int
    deflections: Real
    before: Real
    after: Real

    def times(self, error: float) -> float:
        """Root mean square of what is left, over the standard error of a displacement in three directions."""
        return float(np.sqrt(np.mean(self.after**2) / 3) / error)


def verify_elastic(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    parameters: Sequence[ElasticParameter],
    *,
    prior: float = 1.0,
) -> HeldOut | None:
    """Identify from four fifths of the postures and predict the rest (Belchior et al. 2013 hold out a second load).

    All deflections of a posture are held out together. None: fewer than ten postures, of which none can be spared.

    Parameters
    ----------
    robot, measured, error, parameters, prior
        As in :func:`millfrf.robot_model.identify_elastic`.
    """
    keys = [np.asarray(case.q).tobytes() for case in measured]
    distinct = list(dict.fromkeys(keys))
    if len(distinct) < FEWEST:
        return None
    order = np.random.default_rng(0).permutation(len(distinct))
    held = {distinct[index] for index in order[::_EVERY]}
    seen = [case for case, key in zip(measured, keys, strict=True) if key not in held]
    unseen = [case for case, key in zip(measured, keys, strict=True) if key in held]
    found = identify_elastic(robot, seen, error, parameters, prior=prior)
    real = np.array([case.displacement for case in unseen])
    missed = [
        np.linalg.norm(predicted_deflections(model, unseen) - real, axis=1)
        for model in (robot, apply_elastic(robot, parameters, found.values))
    ]
    return HeldOut(len(held), np.linalg.norm(real, axis=1), missed[0], missed[1])
