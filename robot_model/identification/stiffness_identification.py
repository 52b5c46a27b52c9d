"""Joint stiffnesses from measured deflections of the tool, with standard errors (Belchior et al. 2013, section 4.2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..finite_elements.constrained_statics import constrained_system
from ..finite_elements.structure import Spring
from ..spatial.spatial_robot import SpatialRobot, structure_at
from .parameter_search import Identification, identify

Real = NDArray[np.float64]

GROUPS = {"radial": (0, 1), "axial": (2,), "tilting": (3, 4), "turning": (5,)}
"""Stiffnesses of a joint and their places in ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``."""


@dataclass(frozen=True)
class Deflection:
    """Joint values q (n_moving,), wrench at the tool (6,), N and N m, displacement of the tool (3,), m."""

    q: Real
    wrench: Real
    displacement: Real


def stiffness_names(robot: SpatialRobot) -> tuple[str, ...]:
    """``joint 1 radial`` ... of all finite stiffnesses but the own motion of passive joints, which is near free.

    Examples
    --------
    >>> from robot_model import read_spatial_robot
    >>> len(stiffness_names(read_spatial_robot("fanuc_s420if").robot))
    33
    """
    return tuple(f"joint {robot.joints[joint].frame} {group}" for joint, group in _free(robot))


def identify_joint_stiffness(
    robot: SpatialRobot,
    measured: Sequence[Deflection],
    error: float,
    *,
    bounds: tuple[float, float] = (1e3, 1e12),
    prior: float = 1.0,
) -> Identification:
    """Find joint stiffnesses that bring the model's deflections nearest to the measured ones.

    ``min sum |delta(k) - delta_measured|^2 / error^2`` over the logarithms (Belchior et al. 2013, Eqs. 26-27; they
    search with a genetic algorithm). The derivative of the compliance at the tool is
    ``dC / d ln k = -sum_c k_c r_c^T r_c`` with r_c the joint's relative displacement for unit loads at the tool.

    Parameters
    ----------
    robot
        Robot whose stiffnesses are the start.
    measured
        Deflections at several postures and loads.
    error : m
        Standard error of a measured displacement.
    bounds
        Lowest and highest stiffness, the same for every joint, N/m or N m/rad.
    prior
        Standard deviation of ln k, which says how well the start is known; 1.0: within a factor e.

    Raises
    ------
    InputError
        No measurements, or an error that is not positive.
    """
    if not measured or not error > 0:
        raise InputError(f"{len(measured)} deflections with standard error {error!r} m; give both, positive")
    problem = _Problem(robot, tuple(measured), error)
    names = stiffness_names(robot)
    start = np.array([robot.joints[joint].stiffness[GROUPS[group][0]] for joint, group in _free(robot)])
    lower, upper = (np.full(len(names), bound) for bound in bounds)
    return identify(problem.residuals, names, lower, upper, start=start, jacobian=problem.jacobian, prior=prior)


def apply_joint_stiffness(robot: SpatialRobot, values: Real) -> SpatialRobot:
    """The robot with stiffnesses in the order of :func:`stiffness_names`."""
    stiffness = np.array([joint.stiffness for joint in robot.joints])
    for (joint, group), value in zip(_free(robot), values, strict=True):
        stiffness[joint, list(GROUPS[group])] = value
    return robot.with_stiffness(stiffness)


def predicted_deflections(robot: SpatialRobot, measured: Sequence[Deflection]) -> Real:
    """Displacement of the tool that the model gives for the same postures and wrenches, m, shape (n, 3)."""
    compliance = _Problem(robot, tuple(measured), 1.0).compliance_and_slopes(robot)[0]
    return np.asarray(np.einsum("kab,kb->ka", compliance, np.array([case.wrench for case in measured]))[:, :3])


class _Problem:
    """Residuals and Jacobian share one factorisation a posture; the last trial is kept."""

    def __init__(self, robot: SpatialRobot, measured: tuple[Deflection, ...], error: float) -> None:
        self.robot, self.measured, self.error = robot, measured, error
        places: dict[bytes, int] = {}
        self.owner = [places.setdefault(np.asarray(case.q).tobytes(), len(places)) for case in measured]
        first = {owner: case.q for case, owner in reversed(list(zip(measured, self.owner, strict=True)))}
        self.structures = [structure_at(robot, first[owner]) for owner in range(len(places))]
        self.wrenches = np.array([case.wrench for case in measured])
        self.key = b""
        self.known: tuple[Real, Real] = (np.zeros(0), np.zeros(0))

    def _at(self, values: Real) -> tuple[Real, Real]:
        if values.tobytes() != self.key:
            self.key = values.tobytes()
            self.known = self.compliance_and_slopes(apply_joint_stiffness(self.robot, values))
        return self.known

    def compliance_and_slopes(self, robot: SpatialRobot) -> tuple[Real, Real]:
        """Compliance (n, 6, 6) and its derivatives over ln k (n, n_parameters, 6, 6), a row for each measurement."""
        compliances, slopes = [], []
        free = _free(robot)
        for structure in self.structures:
            springs = tuple(
                replace(spring, stiffness=joint.stiffness)
                for spring, joint in zip(structure.springs, robot.joints, strict=True)
            )
            system = constrained_system(replace(structure, springs=springs))
            motion = np.vstack([np.zeros((6, 6)), system.tip_responses()]).reshape(-1, 6, 6)
            compliances.append(motion[structure.tip])
            relative = [_relative(spring, structure.positions, motion) for spring in springs]
            slopes.append([_slope(relative[joint], robot.joints[joint].stiffness, group) for joint, group in free])
        return np.array(compliances)[self.owner], np.array(slopes)[self.owner]

    def residuals(self, values: Real) -> Real:
        found = np.einsum("kab,kb->ka", self._at(values)[0], self.wrenches)[:, :3]
        return np.asarray((found - [case.displacement for case in self.measured]).ravel() / self.error)

    def jacobian(self, values: Real) -> Real:
        slopes = np.einsum("kpab,kb->kap", self._at(values)[1][:, :, :3], self.wrenches)
        return np.asarray(slopes.reshape(-1, slopes.shape[-1]) / self.error)


def _relative(spring: Spring, positions: Real, motion: Real) -> Real:
    """The joint's relative displacement for unit loads at the tool, in its axes, shape (6, 6)."""
    before, after = spring.motions(positions)
    return np.asarray(after @ motion[spring.nodes[1]] - before @ motion[spring.nodes[0]])


def _slope(relative: Real, stiffness: Real, group: str) -> Real:
    rows = list(GROUPS[group])
    return -(relative[rows].T * stiffness[rows]) @ relative[rows]


def _free(robot: SpatialRobot) -> list[tuple[int, str]]:
    """Joint index and group of every stiffness that can be identified."""
    free = {
        frame.name: "axial" if frame.motion == "prismatic" else "turning"
        for frame in robot.mechanism.frames
        if not frame.active
    }
    return [
        (index, group)
        for index, joint in enumerate(robot.joints)
        for group, places in GROUPS.items()
        if np.isfinite(joint.stiffness[places[0]]) and free.get(joint.frame) != group
    ]
