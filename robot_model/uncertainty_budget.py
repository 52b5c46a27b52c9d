"""Uncertainty of a drilled hole's position: a budget by quadratic sums, and a Monte Carlo trial beside it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .drilling_deviation import joint_deviation
from .loop_closure import tool_jacobian
from .spatial_robot import SpatialRobot, drive_stiffness

Real = NDArray[np.float64]

ROBOT_REPEATABILITY = 40e-6
"""U_robpos of the paper's robot without loads, after ISO 9283, m."""


@dataclass(frozen=True)
class UncertaintyBudget:
    """Expanded uncertainties (coverage factor 2), m (Ferreras-Higuero et al., Eqs. 3-6).

    Parameters
    ----------
    robot_position
        U_robpos: robot without load.
    robot_deformation
        U_robdef: from what is not known of forces and stiffness.
    machining
        U_mach: axis of the tool, runout and the tool's own deformation together.
    """

    robot_position: float
    robot_deformation: float
    machining: float

    @property
    def robot(self) -> float:
        """``U_robot^2 = U_robpos^2 + U_robdef^2`` (Eq. 4), m."""
        return float(np.hypot(self.robot_position, self.robot_deformation))

    @property
    def work(self) -> float:
        """``U_work^2 = U_robot^2 + U_mach^2`` (Eq. 3), m."""
        return float(np.hypot(self.robot, self.machining))

    @property
    def process_share(self) -> float:
        """Part of U_work^2 that the process makes: machining and deformation under its forces."""
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
    """Relative standard uncertainties of the wrench and of each joint's stiffness."""

    wrench: float = 0.05
    stiffness: float = 0.10


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
    """Finest IT grade, 6 to 16, whose tolerance at this diameter is at least ``width`` (m); 17 where none is.

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
