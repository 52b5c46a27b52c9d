"""Misfit of a robot to its measurements, as sums over spectral lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.core import Real

from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import UpdateParameter
from .matrices import PostureSystem, posture_system
from .posed_receptance import PosedReceptance
from .posture_response import answer, receptance_of


@dataclass(frozen=True)
class Problem:
    """What is freed, and what was measured.

    Parameters
    ----------
    parameters
        Numbers that are freed.
    postures
        Measurements, each with the robot's matrices in its posture.
    """

    parameters: tuple[UpdateParameter, ...]
    postures: tuple[tuple[PosedReceptance, PostureSystem], ...]

    @property
    def precision(self) -> Real:
        """Precision of the belief before anything is measured, (n_parameters,)."""
        return np.array([1 / one.spread**2 for one in self.parameters])

    def without(self, index: int) -> "Problem":
        """The problem with one measurement left out."""
        return Problem(self.parameters, self.postures[:index] + self.postures[index + 1 :])

    def only(self, index: int) -> "Problem":
        """The problem of one measurement."""
        return Problem(self.parameters, self.postures[index : index + 1])


def problem_of(
    robot: SpatialRobot, parameters: Sequence[UpdateParameter], measured: Sequence[PosedReceptance]
) -> Problem:
    """Assemble the robot in the posture of each measurement."""
    postures = [(one, posture_system(robot, parameters, one.q, one.axes, one.sensor)) for one in measured]
    return Problem(tuple(parameters), tuple(postures))


@dataclass(frozen=True)
class Sums:
    """Sums of one posture over whitened lines: error r, its slopes J over x and G over what modes may be off.

    Parameters
    ----------
    rr, rj, rg, jj, jg, gg
        Products of the three.
    count : float
        Independent real numbers behind them.
    outside : float
        Sum of the squared errors that neither J nor G can take up.
    likeness : float
        Correlation of that rest along the lines, summed: 0 where neighbouring lines err apart.
    """

    rr: float
    rj: Real
    rg: Real
    jj: Real
    jg: Real
    gg: Real
    count: float
    outside: float
    likeness: float


def sums_at(problem: Problem, x: Real) -> list[Sums]:
    """Sums of every posture at differences x.

    Raises
    ------
    LinAlgError
        Numbers that leave no positive mass.
    """
    return [_sums(problem.parameters, measured, system, x) for measured, system in problem.postures]


def _sums(parameters: Sequence[UpdateParameter], measured: PosedReceptance, system: PostureSystem, x: Real) -> Sums:
    found = answer(system, parameters, x, measured.lines, measured.rows, measured.columns)
    error = measured.whitened(measured.as_measured(found.values) - measured.values)
    slopes = measured.whitened(measured.as_measured(found.slopes)).T
    modes = measured.whitened(measured.as_measured(found.mode_slopes)).T * found.mode_sizes
    spanned = np.hstack([slopes, modes])
    size = np.sqrt(np.sum(spanned**2, axis=0))
    unit = spanned / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(unit.T @ unit)
    kept = vectors[:, values > 1e-10 * values[-1]] / np.sqrt(values[values > 1e-10 * values[-1]])
    left = error - unit @ (kept @ (kept.T @ (unit.T @ error)))
    spare = max(measured.count * (1 - kept.shape[1] / max(len(error), 1)), 1.0)
    return Sums(
        float(error @ error),
        slopes.T @ error,
        modes.T @ error,
        slopes.T @ slopes,
        slopes.T @ modes,
        modes.T @ modes,
        measured.count,
        float(left @ left) / spare if measured.projection is None else 1.0,
        _likeness(left, measured),
    )


def _likeness(left: Real, measured: PosedReceptance) -> float:
    """Sum of the positive autocorrelations of a rest along the lines, up to five lines apart."""
    if measured.projection is not None:
        return 0.0
    half = len(left) // 2
    lines = (left[:half] + 1j * left[half:]).reshape(len(measured.frequencies), -1)
    whole = float(np.sum(np.abs(lines) ** 2))
    if not whole:
        return 0.0
    lags = range(1, min(6, len(lines) // 4))
    return float(sum(max(float(np.real(np.vdot(lines[k:], lines[:-k]))), 0.0) / whole for k in lags))


def weighed(sums: Sequence[Sums], scale: float, modes_off: float) -> tuple[float, Real, Real]:
    """Misfit, gradient half and Gauss-Newton matrix, with what modes may be off taken out.

    ``r^T (s^2 I + t^2 G G^T)^-1 r`` by Woodbury's identity.

    Parameters
    ----------
    sums
        Sums of the postures.
    scale
        Variance of the whitened errors, s^2.
    modes_off
        Standard deviation t of a mode's relative frequency about the robot's.
    """
    misfit, gradient, matrix = 0.0, np.zeros_like(sums[0].rj), np.zeros_like(sums[0].jj)
    for one in sums:
        misfit += one.rr
        gradient = gradient + one.rj
        matrix = matrix + one.jj
        if modes_off > 0 and len(one.gg):
            held = np.linalg.cholesky(one.gg + np.eye(len(one.gg)) * scale / modes_off**2)
            r, j = np.linalg.solve(held, one.rg), np.linalg.solve(held, one.jg.T)
            misfit -= float(r @ r)
            gradient = gradient - j.T @ r
            matrix = matrix - j.T @ j
    return misfit / scale, gradient / scale, matrix / scale


def misfit_of(problem: Problem, index: int, x: Real) -> float:
    """Root mean square of one posture's errors, in units of the noise: 1 where the robot predicts it to the noise."""
    measured, system = problem.postures[index]
    found = receptance_of(system, problem.parameters, x, measured.lines, measured.rows, measured.columns)
    error = measured.whitened(measured.as_measured(found) - measured.values)
    return float(np.sqrt(error @ error / measured.count))
