"""Uncertainty of a drilled hole's position: a budget by quadratic sums, and a Monte Carlo check of it."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real

from ..kinematics.mechanism import tool_jacobian
from ..spatial.spatial_robot import SpatialRobot, drive_stiffness
from .drilling_deviation import joint_deviation


@dataclass(frozen=True)
class UncertaintyBudget:
    """Expanded uncertainties (coverage factor 2), m (Ferreras-Higuero et al., Eqs. 3-6).

    Parameters
    ----------
    robot_position
        U_robpos: robot without load, its pose repeatability after ISO 9283 (the paper's: 40 um); None: unknown.
    robot_deformation
        U_robdef: from the uncertainty of forces and stiffness.
    machining
        U_mach: axis of the tool, runout and the tool's own deformation together; None: unknown.
    """

    robot_position: float | None
    robot_deformation: float
    machining: float | None

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return the names of unknown parts, which are left out; with any of them the sums are lower bounds."""
        parts = {"robot without load": self.robot_position, "machining": self.machining}
        return tuple(name for name, value in parts.items() if value is None)

    @property
    def robot(self) -> float:
        """Compute U_robot from the known parts, m: ``U_robot^2 = U_robpos^2 + U_robdef^2`` (Eq. 4)."""
        return float(np.hypot(self.robot_position or 0.0, self.robot_deformation))

    @property
    def work(self) -> float:
        """Compute U_work from the known parts, m: ``U_work^2 = U_robot^2 + U_mach^2`` (Eq. 3)."""
        return float(np.hypot(self.robot, self.machining or 0.0))

    @property
    def machining_share(self) -> float:
        """Compute the share of machining alone in U_work^2; deformation of the robot counts in U_robot (Eqs. 3 and 4).

        The paper states "up to 40 %": without deformation the share is 36 % for a drill of 8 mm and 69 % for 12 mm;
        69 % falls to 40 % if ``U_robdef`` reaches 62 um. An unknown part raises an `InputError`.
        """
        return self._known_machining("machining's") ** 2 / self.work**2

    @property
    def process_share(self) -> float:
        """Compute the share of the process in U_work^2: machining, and deformation under the process forces.

        An unknown part raises an `InputError`.
        """
        return (self._known_machining("the process's") ** 2 + self.robot_deformation**2) / self.work**2

    def _known_machining(self, whose: str) -> float:
        if self.robot_position is None or self.machining is None:
            raise InputError(f"{whose} share is unknown, because {', '.join(self.unknown)} is; give a value")
        return self.machining


def machining_uncertainty(axis: float, runout: float, tool_deformation: float) -> float:
    """Compute U_mach from ``U_mach^2 = U_axis^2 + U_rho^2 + U_deftool^2`` (Eq. 6), m."""
    return float(np.sqrt(axis**2 + runout**2 + tool_deformation**2))


def measured_machining_uncertainty(diameter: float) -> float:
    """Interpolate the measured U_mach, m, from 30 um at 8 mm to 60 um at 12 mm (section 2.2 of the paper).

    Raises
    ------
    InputError
        A diameter outside 8 to 12 mm: the paper measured none.

    Examples
    --------
    >>> round(1e6 * measured_machining_uncertainty(0.010))
    45
    """
    if not 8e-3 <= diameter <= 12e-3:
        raise InputError(f"the uncertainty of machining is known for drills of 8 to 12 mm, not {1e3 * diameter:g} mm")
    return float(np.interp(diameter, [8e-3, 12e-3], [30e-6, 60e-6]))


@dataclass(frozen=True)
class LoadUncertainty:
    """Relative standard uncertainties of the wrench and of each joint's stiffness; the default values are assumed."""

    wrench: float = 0.05
    stiffness: float = 0.10

    def __post_init__(self) -> None:
        for name, value in (("forces", self.wrench), ("joint stiffness", self.stiffness)):
            if not 0 <= value <= 1:
                raise InputError(f"{name} known to {100 * value:g} %: give 0 to 100")


def deformation_uncertainty(robot: SpatialRobot, q: Real, wrench: Real, known: LoadUncertainty) -> float:
    """Compute the expanded uncertainty of the length of the deviation to first order, m.

    The deviation is ``delta = -J diag(1 / k) J^T W``; the errors of stiffnesses and wrench are independent.

    Parameters
    ----------
    robot
        Robot, an open chain.
    q : (n_moving,), rad or m
        Joint values of the posture.
    wrench : (6,), N and N m
        Force and moment on the tool, in the base frame.
    known
        Relative uncertainty of wrench and stiffness.
    """
    jacobian = tool_jacobian(robot.mechanism, q)
    parts = -jacobian[:3] * (jacobian.T @ wrench) / drive_stiffness(robot)
    deviation = parts.sum(axis=1)
    direction = deviation / max(float(np.linalg.norm(deviation)), 1e-300)
    along = direction @ parts
    variance = float(np.sum(along**2) * known.stiffness**2 + along.sum() ** 2 * known.wrench**2)
    return 2 * float(np.sqrt(variance))


def lateral_uncertainty(
    robot: SpatialRobot, q: Real, wrench: Real, known: LoadUncertainty, axis: Real, resting: Real | None = None
) -> float:
    """Compute the expanded uncertainty (m) of the deviation across the drill's axis, in the worst direction.

    To first order it is ``U = 2 sqrt(lambda_max)`` with the largest eigenvalue of the covariance
    ``P (s_k^2 sum_j d_j d_j^T + s_w^2 d d^T) P``: d_j is the deviation by joint j, d the sum of all d_j under the
    forces of the process alone, and P the projection across the axis.

    Parameters
    ----------
    robot, q, wrench, known
        Robot, joint values, load on the tool and its uncertainty, as in :func:`deformation_uncertainty`.
    axis : (3,)
        Unit vector along the hole.
    resting : (3, n_active), m, or None
        Deflection by each joint under weight (:func:`millfrf.robot_model.sag_parts`) if weight counts: it has the
        error of the stiffness, not of the forces.
    """
    jacobian = tool_jacobian(robot.mechanism, q)
    process = jacobian[:3] * (jacobian.T @ wrench) / drive_stiffness(robot)
    parts = process if resting is None else process + resting
    deviation = process.sum(axis=1)
    covariance = known.stiffness**2 * parts @ parts.T + known.wrench**2 * np.outer(deviation, deviation)
    across = np.eye(3) - np.outer(axis, axis)
    return 2 * float(np.sqrt(np.linalg.eigvalsh(across @ covariance @ across)[-1]))


def position_tolerance(systematic: float, expanded: float) -> float:
    """Compute the position tolerance that a hole needs, m: diameter of the zone of its axis, ``t = 2 (|d| + U)``.

    The axis may lie anywhere within t / 2 of its true place (ISO 1101, position; ISO 5458), so a radial deviation
    counts twice. A systematic deviation d is added to U, because it has one direction and is no scatter (JCGM 100,
    F.2.4.5). ISO 286 grades are of sizes, such as the hole's diameter, and do not grade a position.

    Parameters
    ----------
    systematic
        Radial distance of the predicted axis from its true place, m.
    expanded
        Expanded uncertainty of that distance, m.

    Raises
    ------
    InputError
        A negative or infinite number.

    Examples
    --------
    >>> round(1e3 * position_tolerance(0.1e-3, 0.05e-3), 6)
    0.3
    """
    if not (np.isfinite(systematic) and np.isfinite(expanded) and expanded >= 0):
        raise InputError(f"deviation {systematic!r} m with U = {expanded!r} m: give finite numbers, U 0 or more")
    return 2 * (abs(systematic) + expanded)


def position_verdict(needed: float, allowed: float, unknown: tuple[str, ...] = ()) -> str:
    """Compare tolerances: ``holds``, ``does not hold``, or ``cannot tell`` if parts of the budget are unknown.

    Parameters
    ----------
    needed : m
        The :func:`position_tolerance` of the known parts.
    allowed : m
        Position tolerance of the drawing.
    unknown
        Parts of the budget that are left out; they can only increase the needed tolerance.

    Examples
    --------
    >>> position_verdict(0.3, 0.2, ("robot without load",)), position_verdict(0.1, 0.2, ("robot without load",))
    ('does not hold', 'cannot tell')
    """
    if not allowed > 0:
        raise InputError(f"position tolerance {allowed!r} m must be positive")
    if needed > allowed:
        return "does not hold"
    return "cannot tell" if unknown else "holds"


def monte_carlo_deformation(
    robot: SpatialRobot, q: Real, wrench: Real, known: LoadUncertainty, *, trials: int = 2000, seed: int = 0
) -> tuple[float, float]:
    """Compute mean and twice the standard deviation of the length of the deviation, m, by random trials.

    Stiffnesses are log-normal, the size of the wrench is normal (JCGM 101, propagation of distributions).
    """
    rng = np.random.default_rng(seed)
    nominal = np.array([joint.stiffness for joint in robot.joints])
    lengths = np.empty(trials)
    for i in range(trials):
        factors = np.exp(known.stiffness * rng.standard_normal(len(nominal)))
        trial = robot.with_stiffness(nominal * factors[:, None])
        trial_wrench = wrench * (1 + known.wrench * rng.standard_normal())
        lengths[i] = np.linalg.norm(joint_deviation(trial, q, trial_wrench))
    return float(lengths.mean()), 2 * float(lengths.std(ddof=1))
