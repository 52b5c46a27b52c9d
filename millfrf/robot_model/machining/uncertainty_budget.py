"""Uncertainty of a drilled hole's position: a budget by quadratic sums, and a Monte Carlo trial beside it."""

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
        U_robdef: from what is not known of forces and stiffness.
    machining
        U_mach: axis of the tool, runout and the tool's own deformation together; None: unknown.
    """

    robot_position: float | None
    robot_deformation: float
    machining: float | None

    @property
    def unknown(self) -> tuple[str, ...]:
        """Parts that are left out because nobody told them; with any, the sums are lower bounds."""
        parts = {"robot without load": self.robot_position, "machining": self.machining}
        return tuple(name for name, value in parts.items() if value is None)

    @property
    def robot(self) -> float:
        """``U_robot^2 = U_robpos^2 + U_robdef^2`` (Eq. 4), m, of what is known."""
        return float(np.hypot(self.robot_position or 0.0, self.robot_deformation))

    @property
    def work(self) -> float:
        """``U_work^2 = U_robot^2 + U_mach^2`` (Eq. 3), m, of what is known."""
        return float(np.hypot(self.robot, self.machining or 0.0))

    @property
    def machining_share(self) -> float:
        """Part of U_work^2 that machining alone makes, the robot's deformation on the robot's side as in Eqs. 3 and 4.

        The paper's "up to 40 %": without deformation it is 36 % with an 8 mm drill and 69 % with one of 12 mm, whose
        share falls to 40 % where ``U_robdef`` reaches 62 um.

        Raises
        ------
        InputError
            A part is unknown: its share cannot be told.
        """
        if self.robot_position is None or self.machining is None:
            raise InputError(f"machining's share cannot be told: {', '.join(self.unknown)} unknown; give a figure")
        return self.machining**2 / self.work**2

    @property
    def process_share(self) -> float:
        """Part of U_work^2 that the process makes: machining and deformation under its forces.

        Raises
        ------
        InputError
            A part is unknown: its share cannot be told.
        """
        if self.robot_position is None or self.machining is None:
            raise InputError(f"the process's share cannot be told: {', '.join(self.unknown)} unknown; give a figure")
        return (self.machining**2 + self.robot_deformation**2) / self.work**2


def machining_uncertainty(axis: float, runout: float, tool_deformation: float) -> float:
    """``U_mach^2 = U_axis^2 + U_rho^2 + U_deftool^2`` (Eq. 6), m."""
    return float(np.sqrt(axis**2 + runout**2 + tool_deformation**2))


def measured_machining_uncertainty(diameter: float) -> float:
    """+-30 um at 8 mm to +-60 um at 12 mm, on a straight line between and no further (section 2.2), m.

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
    """Relative standard uncertainties of the wrench and of each joint's stiffness; these two are assumed."""

    wrench: float = 0.05
    stiffness: float = 0.10

    def __post_init__(self) -> None:
        for name, value in (("forces", self.wrench), ("joint stiffness", self.stiffness)):
            if not 0 <= value <= 1:
                raise InputError(f"{name} known to {100 * value:g} %: give 0 to 100")


def deformation_uncertainty(robot: SpatialRobot, q: Real, wrench: Real, known: LoadUncertainty) -> float:
    """Expanded uncertainty of the deviation's length, first order, m.

    ``delta = -J diag(1 / k) J^T W``; each stiffness and the size of the wrench are independent.
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
    """Compute the expanded uncertainty (m) of the deviation across the drill's axis, worst direction, first order.

    ``U = 2 sqrt(lambda_max)`` of the covariance ``P (s_k^2 sum_j d_j d_j^T + s_w^2 d d^T) P`` with d_j the part of
    joint j, d their sum under the process alone, and P across the axis.

    Parameters
    ----------
    robot, q, wrench, known
        Robot, joint values, load on the tool and its uncertainty, as in :func:`deformation_uncertainty`.
    axis : (3,)
        Unit vector along the hole.
    resting : (3, n_active), m, or None
        Deflection by each joint under weight (:func:`millfrf.robot_model.sag_parts`) where weight counts: it has the
        error of
        the stiffness, not of the forces.
    """
    jacobian = tool_jacobian(robot.mechanism, q)
    process = jacobian[:3] * (jacobian.T @ wrench) / drive_stiffness(robot)
    parts = process if resting is None else process + resting
    deviation = process.sum(axis=1)
    covariance = known.stiffness**2 * parts @ parts.T + known.wrench**2 * np.outer(deviation, deviation)
    across = np.eye(3) - np.outer(axis, axis)
    return 2 * float(np.sqrt(np.linalg.eigvalsh(across @ covariance @ across)[-1]))


def position_tolerance(systematic: float, expanded: float) -> float:
    """Position tolerance that a hole needs, m: diameter of the cylindrical zone of its axis, ``t = 2 (|d| + U)``.

    The axis may lie anywhere within t / 2 of its true place (ISO 1101, position; ISO 5458), so a radial deviation
    counts twice. A systematic deviation d adds to U as it is: it has one direction and is no scatter (JCGM 100,
    F.2.4.5). ISO 286 grades (:func:`tolerance_grade`) are of sizes, the hole's diameter, and do not grade a position.

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
    """Say ``holds``, ``does not hold``, or ``cannot tell`` where parts of the budget are unknown.

    Parameters
    ----------
    needed : m
        The :func:`position_tolerance` of what is known.
    allowed : m
        Position tolerance of the drawing.
    unknown
        Parts of the budget that are left out: they can only make it worse.

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
    """Mean of the deviation's length, m, and twice its standard deviation, from trials without linearisation.

    Stiffnesses are log-normal, the size of the wrench normal (JCGM 101, propagation of distributions).
    """
    rng = np.random.default_rng(seed)
    nominal = np.array([joint.stiffness for joint in robot.joints])
    lengths = np.empty(trials)
    for i in range(trials):
        factors = np.exp(known.stiffness * rng.standard_normal(len(nominal)))
        trial = robot.with_stiffness(nominal * factors[:, None])
        pushed = wrench * (1 + known.wrench * rng.standard_normal())
        lengths[i] = np.linalg.norm(joint_deviation(trial, q, pushed))
    return float(lengths.mean()), 2 * float(lengths.std(ddof=1))


def tolerance_grade(width: float, diameter: float) -> int:
    """Finest IT grade, 6 to 16, whose tolerance of a diameter is at least ``width`` (m); 17 where none is.

    It grades a size alone; :func:`position_tolerance` grades the position of a hole.
    ``i = 0.45 D^(1/3) + 0.001 D`` um with D in mm, the geometric mean of its step; IT6 = 10 i and so on (ISO 286-1).

    Raises
    ------
    InputError
        A diameter outside 3 to 30 mm.

    Examples
    --------
    >>> tolerance_grade(15e-6, 8e-3)
    8
    """
    steps = np.array([3.0, 6.0, 10.0, 18.0, 30.0])
    mm = 1e3 * diameter
    if not steps[0] < mm <= steps[-1]:
        raise InputError(f"tolerance grades are given for holes of 3 to 30 mm, not {mm:g} mm")
    upper = int(np.searchsorted(steps, mm))
    mean = float(np.sqrt(steps[upper - 1] * steps[upper]))
    unit = 0.45 * mean ** (1 / 3) + 0.001 * mean
    factors = (10, 16, 25, 40, 64, 100, 160, 250, 400, 640, 1000)
    return next((grade for grade, factor in enumerate(factors, 6) if factor * unit >= 1e6 * width), 17)
