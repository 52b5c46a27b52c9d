"""One mode of the dynamometer along each axis, inferred from the harmonics of the cuts and tried on left-out cuts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import scipy

from millfrf.core import Complex, Real

from .coefficient_fit import CoefficientFit
from .cut_forces import CutForces
from .force_problem import SCAN, At, ForceProblem, evenly_weighted

FREQUENCIES = 24  # at which a search begins, between the second order and half above the highest
DAMPINGS = (0.02, 0.08)  # likewise
BOUNDS = (2e-3, 1.0)  # of the damping ratio
ABOVE = 1.5  # highest frequency of a mode over that of the highest order; beyond it only its stiffness would count
MODE_STEP = 1e-3  # relative, of the differences for the error bars
STIFF = 1e3  # frequency over the highest order's at which a mode changes nothing, and a search begins
ROUNDS = 25  # of the search


@dataclass(frozen=True)
class Ringing:
    """Inferred transfer ``w_0^2 / (w_0^2 - w^2 + 2 i zeta w_0 w)`` of the dynamometer along each measured axis.

    Parameters
    ----------
    modes : (n_axes, 2)
        Natural frequency, Hz, and damping ratio.
    chances : (n_axes,)
        Probability by which the mode along an axis reduces the misfit as much without a cause (F-test).
    misfit
        Share of the forces' root mean square that remains.
    held_out, held_out_rigid : (n_cuts,)
        Misfit of each cut by all parameters of the others, with modes and without; its angle alone is fitted.
    """

    modes: Real
    chances: Real
    misfit: float
    held_out: Real
    held_out_rigid: Real

    def explains(self, largest: float) -> bool:
        """Return whether the modes predict each left-out cut better, and to a misfit of ``largest`` or less."""
        return bool((self.held_out < np.minimum(self.held_out_rigid, largest)).all())


def moved_modes(cuts: Sequence[CutForces], modes: Real) -> list[list[CutForces]]:
    """Return the cuts with each parameter of the modes enlarged in turn by a thousandth."""
    moved = []
    for place in np.ndindex(modes.shape):
        changed = modes.copy()
        changed[place] *= 1 + MODE_STEP
        moved.append(with_modes(cuts, changed))
    return moved


def mode_transfer(cut: CutForces, modes: Real) -> Complex:
    """Return the transfer of one mode along each axis at a cut's orders, (n_orders, n_axes, n_axes)."""
    ratio = np.arange(cut.top + 1)[:, None, None] * cut.turning[:, None] / modes[:, 0]
    transfer = (1 / (1 - ratio**2 + 2j * modes[:, 1] * ratio)).mean(axis=1)
    return np.asarray(transfer[:, :, None] * np.eye(len(modes)))


def with_modes(cuts: Sequence[CutForces], modes: Real) -> list[CutForces]:
    """Return cuts whose computed forces pass one mode along each axis."""
    return [replace(cut, transfer=mode_transfer(cut, modes)) for cut in cuts]


def find_ringing(cuts: Sequence[CutForces], fit: CoefficientFit) -> Ringing:
    """Fit one mode along each axis together with coefficients, runout and angles, and leave each cut out in turn.

    Parameters
    ----------
    cuts
        Forces of at least three cuts, without a transfer.
    fit
        Their fit by a rigid dynamometer.
    """
    problem = evenly_weighted(cuts)
    modes, misfits = _scanned(problem, fit)
    start = _Point(fit.angles, np.array(fit.runout), modes)
    best = _searched(problem, start)
    assert best.modes is not None
    rest, total = float(np.sum(best.residual(problem) ** 2)), float(np.sum(problem.measured**2))
    freedom = max(fit.freedom - best.modes.size, 1)
    ratios = [(before - after) / 2 / (after / freedom) for before, after in pairwise(misfits)]
    held_out, held_out_rigid = [], []
    for left_out in range(len(cuts)):
        rigid_point = replace(best, angles=fit.angles, modes=None)
        held_out.append(_left_out(cuts, left_out, best))
        held_out_rigid.append(_left_out(cuts, left_out, rigid_point))
    return Ringing(
        best.modes,
        np.asarray(scipy.stats.f.sf(ratios, 2, freedom)),
        float(np.sqrt(rest / total)),
        np.array(held_out),
        np.array(held_out_rigid),
    )


@dataclass(frozen=True)
class _Point:
    """Angles, runout and modes of a fit."""

    angles: Real
    runout: Real
    modes: Real | None

    def seen(self, problem: ForceProblem) -> ForceProblem:
        return problem if self.modes is None else replace(problem, cuts=with_modes(problem.cuts, self.modes))

    def design(self, problem: ForceProblem) -> Real:
        return problem.design(self.seen(problem).spectra(self.runout), self.angles)

    def residual(self, problem: ForceProblem) -> Real:
        return problem.solve(self.design(problem))[1]


def _scanned(problem: ForceProblem, fit: CoefficientFit) -> tuple[Real, list[float]]:
    """Return the modes of a grid that reduce the misfit most, one axis after the other, and the misfits on the way."""
    axes = len(problem.cuts[0].axes)
    turning, top = float(problem.cuts[0].turning.mean()), float(problem.orders[-1])
    grid = np.geomspace(2 * turning, ABOVE * top * turning, FREQUENCIES)
    modes = np.tile([STIFF * top * turning, DAMPINGS[0]], (axes, 1))
    misfits = [problem.misfit(At(fit.angles, np.array(fit.runout)))]
    for axis in range(len(modes)):
        tried = []
        for frequency in grid:
            for damping in DAMPINGS:
                modes[axis] = frequency, damping
                point = _Point(fit.angles, np.array(fit.runout), modes.copy())
                tried.append((float(np.sum(point.residual(problem) ** 2)), frequency, damping))
        modes[axis] = min(tried)[1:]
        misfits.append(min(tried)[0])
    return modes, misfits


def _searched(problem: ForceProblem, start: _Point) -> _Point:
    """Return the point of the smallest misfit near a start; without modes if the start has none."""
    n, n_offsets, unit = len(start.angles), problem.n_offsets, problem.largest_feed
    turning, top = float(problem.cuts[0].turning.mean()), float(problem.orders[-1])
    low = np.array([turning, BOUNDS[0]])
    high = np.array([ABOVE * top * turning * 1.01, BOUNDS[1]])

    def point(x: Real) -> _Point:
        runout = np.concatenate([x[n : n + n_offsets] * unit, np.zeros(2 - n_offsets)])
        modes = None if start.modes is None else np.exp(x[n + n_offsets :].reshape(-1, 2))
        return _Point(x[:n], runout, modes)

    first = [start.angles, start.runout[:n_offsets] / unit]
    ends = [np.full(n + n_offsets, np.inf)]
    floor = [-ends[0]]
    if start.modes is not None:
        first.append(np.log(start.modes).ravel())
        floor.append(np.tile(np.log(low), len(start.modes)))
        ends.append(np.tile(np.log(high), len(start.modes)))
    bounds = np.concatenate(floor), np.concatenate(ends)
    inside = np.clip(np.concatenate(first), *bounds)  # a left-out cut may be the fastest
    solution = scipy.optimize.least_squares(
        lambda x: point(x).residual(problem), inside, diff_step=1e-4, x_scale="jac", bounds=bounds, max_nfev=ROUNDS
    )  # fmt: skip
    return point(solution.x)


def _left_out(cuts: Sequence[CutForces], number: int, start: _Point) -> float:
    """Return the misfit of a cut by the coefficients, runout and modes of the others; only its angle is its own."""
    others = [cut for k, cut in enumerate(cuts) if k != number]
    problem, alone = evenly_weighted(others), evenly_weighted([cuts[number]])
    best = _searched(problem, replace(start, angles=np.delete(start.angles, number)))
    coefficients = problem.solve(best.design(problem))[0]
    scan = start.angles[number] + 2 * np.pi * np.arange(SCAN) / SCAN
    misfits = []
    for angle in scan:
        design = replace(best, angles=np.array([angle])).design(alone)
        misfits.append(float(np.sum((alone.measured - design @ coefficients) ** 2)))
    return float(np.sqrt(min(misfits) / np.sum(alone.measured**2)))
