"""Elasticity of a robot from measured deflections of the tool, with standard errors (Belchior et al. 2013, 4.2)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..finite_elements import constrained_system, rigid_motion
from ..spatial import SpatialRobot, structure_at
from .elastic_parameters import ElasticParameter, joint_parameters
from .parameter_search import Identification, identify

Real = NDArray[np.float64]


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
    >>> from robot_model import read_spatial_robot
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
        Numbers to find: :func:`robot_model.joint_parameters`, :func:`robot_model.link_parameters`, or both.
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
