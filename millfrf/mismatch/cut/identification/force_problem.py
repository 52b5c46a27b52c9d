"""Least squares of spindle orders over coefficients, exponents, runout and the angles at which recordings begin."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from millfrf.core import Complex, Index, InputError, Real

from .cut_forces import CutForces
from .turn_model import CONSTANT, basis_spectra

SCAN = 120  # angles of tooth 0 at which a fit begins, over one revolution
RUNOUTS = (0.03, 0.08, 0.2, 0.4, 0.8)  # radial offsets at which a fit begins, as shares of the largest feed per tooth
RUNOUT_ANGLES = 6  # directions of the offset at which a fit begins, from three teeth on
MEAN_ROUNDS = 3  # of weighting mean forces by the misfit
STARTS = 4  # points of the grid that are refined
LEAST_VARIANCE = 1e-12  # N^2: of a difference
LARGEST_CONDITION = 1e4  # of the scaled normal equations' root: beyond it the cuts do not separate the coefficients


def teeth_offsets(teeth: int, runout: Real) -> Real:
    """Return the radial offset of each tooth, (teeth,), m."""
    around = 2 * np.pi * np.arange(teeth) / teeth
    return np.asarray(runout[0] * np.cos(around) + runout[1] * np.sin(around))


class ForceLaw(NamedTuple):
    """Parts of the force that are fitted besides the cutting coefficients."""

    has_edges: bool = True  # edge forces
    has_exponents: bool = False  # exponents of the chip thickness


EDGES = ForceLaw()
EXPONENTS = ForceLaw(has_edges=False, has_exponents=True)
EDGES_AND_EXPONENTS = ForceLaw(has_exponents=True)


class At(NamedTuple):
    """Unknowns in which the force is not linear."""

    angles: Real  # (n_cuts,), rad: of tooth 0 where each recording begins
    runout: Real  # (2,), m: components
    exponents: Real = CONSTANT  # (3,)
    tilt: Real | None = None  # (2,), m: what the runout is more at the upper end of the cut, and less at the tip


@dataclass(frozen=True)
class ForceProblem:
    """Least squares over the coefficients for given angles, runout and exponents."""

    cuts: Sequence[CutForces]
    top: int | None = None
    variance: float = 0.0  # of a difference beyond noise and drift, N^2
    law: ForceLaw = EDGES
    reference: float = 1e-3  # m: chip thickness at which the coefficients hold

    @cached_property
    def orders(self) -> Index:
        top = min(cut.top for cut in self.cuts) if self.top is None else self.top
        return np.arange(top + 1)

    @cached_property
    def known(self) -> list[int]:
        """Coefficients of the law that a measured axis shows."""
        unseen = self.unseen
        if unseen and min(cut.process.edge_angle for cut in self.cuts) < np.pi / 2 - 1e-6:
            raise InputError(
                "the force along Z is missing, and edges at less than 90 deg mix radial and axial force; record Fz too"
            )
        return [k for k in range(6 if self.law.has_edges else 3) if k not in unseen]

    @cached_property
    def unseen(self) -> list[int]:
        """Coefficients and exponents, of nine, that no measured axis shows."""
        return [2, 5, 8] if {axis for cut in self.cuts for axis in cut.axes} <= {0, 1} else []

    @cached_property
    def bent(self) -> list[int]:
        """Coefficients whose exponents are fitted."""
        return [k for k in self.known if k < 3] if self.law.has_exponents else []

    @cached_property
    def n_offsets(self) -> int:
        """Components of runout that the number of teeth shows."""
        return min(2, max(0, min(cut.process.teeth for cut in self.cuts) - 1))

    @property
    def largest_feed(self) -> float:
        """Largest feed per tooth of the cuts, m: the unit of runout."""
        return max(cut.process.feed_per_tooth for cut in self.cuts)

    @cached_property
    def measured(self) -> Real:
        pairs = zip(self.cuts, self.weights, strict=True)
        return np.concatenate([self.flat(weight * cut.mean[self.orders]) for cut, weight in pairs])

    def flat(self, values: Complex) -> Real:
        """Return real and imaginary parts of one cut's orders in a row; a mean has no imaginary part."""
        return np.concatenate([values.real.ravel(), values.imag[1:].ravel()])

    @cached_property
    def weights(self) -> list[Real]:
        twice = np.where(self.orders > 0, np.sqrt(2.0), 1.0)[:, None]  # an order stands for its conjugate too
        return [twice / np.sqrt(np.maximum(variance + self.variance, LEAST_VARIANCE)) for variance in self.noise]

    @cached_property
    def noise(self) -> list[Real]:
        """Variance of each order of each cut from its scatter and, of the means, from the drift of zero, N^2."""
        noise = [cut.error[self.orders] ** 2 for cut in self.cuts]
        for variance, cut in zip(noise, self.cuts, strict=True):
            variance[0] += cut.drift**2
        return noise

    def spectra(self, runout: Real, exponents: Real = CONSTANT, tilt: Real | None = None) -> list[Complex]:
        """Basis of each cut, (n_known, n_orders, n_axes)."""
        basis = []
        for cut in self.cuts:
            teeth, top = cut.process.teeth, int(self.orders[-1])
            offsets, powers = tuple(teeth_offsets(teeth, runout).tolist()), tuple(exponents.tolist())
            tilts = None if tilt is None else tuple(teeth_offsets(teeth, tilt).tolist())
            whole = basis_spectra(cut.process, cut.depth, offsets, top, powers, self.reference, tilts)
            applied = whole[np.ix_(np.array(self.known), self.orders, np.array(cut.axes))]
            if cut.transfer is not None:
                applied = np.einsum("kpq,nkq->nkp", cut.transfer[self.orders], applied)
            basis.append(applied)
        return basis

    def design(self, basis: Sequence[Complex], angles: Real) -> Real:
        rows = []
        for spectra, weight, angle in zip(basis, self.weights, angles, strict=True):
            turned = spectra * np.exp(1j * self.orders * angle)[:, None] * weight
            rows.append(np.array([self.flat(column) for column in turned]).T)
        return np.concatenate(rows)

    def solve(self, design: Real) -> tuple[Real, Real]:
        """Return the coefficients (n_known,) and the weighted residual."""
        scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
        solution = np.linalg.lstsq(design / scale, self.measured, rcond=None)[0] / scale
        return solution, self.measured - design @ solution

    def solved(self, at: At) -> tuple[Real, Real]:
        """Return all six coefficients and the covariance (9, 9) of coefficients and exponents, which are given."""
        design = self.design_at(at)
        self.require_separated(design)
        solution, residual = self.solve(design)
        freedom = max(len(residual) - len(solution), 1)
        factor = max(float(residual @ residual) / freedom, 1.0)
        return self.filled(solution), self.filled_square(factor * inverse_square(design), self.known)

    def design_at(self, at: At) -> Real:
        """Return the derivative of the weighted orders by the coefficients."""
        return self.design(self.spectra(at.runout, at.exponents, at.tilt), at.angles)

    def require_separated(self, design: Real) -> None:
        scale = np.linalg.norm(design, axis=0)
        if len(design) < design.shape[1] or not (scale > 0).all() or np.linalg.cond(design / scale) > LARGEST_CONDITION:
            raise InputError(
                "these cuts do not separate the cutting from the edge forces; cut the same engagement at three or more "
                "feeds, the largest at least twice the smallest"
            )

    def misfit(self, at: At) -> float:
        """Return the sum of the squared weighted differences."""
        return float(np.sum(self.solve(self.design_at(at))[1] ** 2))

    def starts(self) -> list[At]:
        """Return the angles and runouts of the grid with the smallest misfits."""
        return [At(angles, runout) for _, angles, runout in self.ranked()[:STARTS]]

    def ranked(self) -> list[tuple[float, Real, Real]]:
        """Return misfit, angles and runout on a grid, the smallest misfit first, with the coefficients of the means."""
        try:
            problem, still = mean_problem(self.cuts)
            coefficients = problem.solved(still)[0][self.known]
        except InputError:
            coefficients = None
        ranked = []
        for offset in self._runouts():
            runout = np.array(offset)
            basis = self.spectra(runout)
            chosen = [self._best_angle(number, basis[number], coefficients) for number in range(len(self.cuts))]
            ranked.append((sum(misfit for misfit, _ in chosen), np.array([a for _, a in chosen]), runout))
        return sorted(ranked, key=lambda entry: entry[0])

    def _runouts(self) -> list[tuple[float, float]]:
        feed = self.largest_feed
        if not self.n_offsets:
            return [(0.0, 0.0)]
        around = np.pi * np.arange(2) if self.n_offsets == 1 else step_around(RUNOUT_ANGLES)
        directions = [(float(np.cos(a)), float(np.sin(a)) * (self.n_offsets - 1)) for a in around]
        return [(0.0, 0.0), *((r * feed * x, r * feed * y) for r in RUNOUTS for x, y in directions)]

    def _best_angle(self, number: int, basis: Complex, coefficients: Real | None) -> tuple[float, float]:
        weight = self.weights[number]
        measured = self.cuts[number].mean[self.orders] * weight
        angles = 2 * np.pi * np.arange(SCAN) / SCAN
        turns = np.exp(1j * np.outer(angles, self.orders))[:, :, None] * weight
        if coefficients is not None:
            computed = turns * np.tensordot(coefficients, basis, 1)
            misfits = np.sum(np.abs(measured - computed) ** 2, axis=(1, 2))
        else:
            columns = (turns[:, None] * basis).reshape(SCAN, len(basis), -1).transpose(0, 2, 1)
            real = np.concatenate([columns.real, columns.imag], axis=1)
            target = np.concatenate([measured.real.ravel(), measured.imag.ravel()])
            misfits = np.array([_least(design, target) for design in real])
        chosen = int(np.argmin(misfits))
        return float(misfits[chosen]), float(angles[chosen])

    def refined(self, start: At) -> At:
        """Return the unknowns of the smallest misfit near a start; the tilt is one of them if the start has one."""
        unit, n, count, bent = self.largest_feed, self.n_offsets, len(start.angles), len(self.bent)

        def unpacked(parameters: Real) -> At:
            angles, runout, powers, tilt = np.split(parameters, np.cumsum([count, n, bent]))
            exponents = start.exponents.copy()
            exponents[self.bent] = powers
            wide = [np.concatenate([part * unit, np.zeros(2 - n)]) for part in (runout, tilt) if len(part) == n]
            return At(angles, wide[0], exponents, None if start.tilt is None else wide[-1])

        tilt = np.zeros(0) if start.tilt is None else start.tilt[:n] / unit
        first = np.concatenate([start.angles, start.runout[:n] / unit, start.exponents[self.bent], tilt])
        # differences wide enough to cross the half degree in which entry and exit are computed
        solution = scipy.optimize.least_squares(
            lambda x: self.solve(self.design_at(unpacked(x)))[1], first, diff_step=1e-4, x_scale=0.1, max_nfev=30
        )
        return unpacked(solution.x)

    def reweighted(self, at: At) -> "ForceProblem":
        """Return the problem with the variance of the misfit beyond the noise of the orders.

        It is the variance with which the weighted squares sum to their degrees of freedom (Paule & Mandel 1982, J. Res.
        Natl. Bur. Stand. 87); a mean whose zero drifts has a noise of its own, and leaves the others as they are.
        """
        solution, residual = self.solve(self.design_at(at))
        offsets = self.n_offsets if at.tilt is None else 2 * self.n_offsets
        searched = 0 if self.orders[-1] == 0 else len(at.angles) + offsets + len(self.bent)
        freedom = max(len(residual) - len(solution) - searched, 1)
        noise = np.concatenate([self.flat(np.asarray(variance * (1 + 1j))) for variance in self.noise])
        squares, least = residual**2 * np.maximum(noise + self.variance, LEAST_VARIANCE), 1e-9 * self.variance

        def excess(variance: float) -> float:
            return float(np.sum(squares / np.maximum(noise + variance, LEAST_VARIANCE))) - freedom

        if excess(least) <= 0:
            return replace(self, variance=least)
        return replace(self, variance=float(scipy.optimize.brentq(excess, least, np.sum(squares) / freedom)))

    def filled(self, solution: Real) -> Real:
        """Return all six coefficients: NaN where no axis shows one, 0 where the law has none."""
        whole = np.zeros(6)
        whole[self.known] = solution
        whole[self.unseen[:2]] = np.nan
        return whole

    def filled_square(self, covariance: Real, numbers: Sequence[int]) -> Real:
        """Return the covariance (9, 9) of coefficients and exponents, of which these are fitted."""
        whole = np.zeros((9, 9))
        whole[np.ix_(numbers, numbers)] = covariance
        whole[self.unseen], whole[:, self.unseen] = np.nan, np.nan
        return whole


def inverse_square(design: Real) -> Real:
    """Return ``(J^T J)^-1`` of columns of any size; a column of zeros gets zeros."""
    scale = np.linalg.norm(design, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.asarray(np.linalg.pinv((design / scale).T @ (design / scale)) / scale[:, None] / scale[None, :])


def step_around(count: int) -> Real:
    """Return ``count`` directions around a circle, rad."""
    return np.asarray(2 * np.pi * np.arange(count) / count)


def _least(design: Real, target: Real) -> float:
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    solution = np.linalg.lstsq(design / scale, target, rcond=1e-6)[0]
    return float(np.sum((target - design / scale @ solution) ** 2))


def evenly_weighted(cuts: Sequence[CutForces]) -> ForceProblem:
    """Return the problem in which the misfit, not the noise of the orders, makes the weights."""
    return ForceProblem(cuts, variance=float(np.mean([np.mean(np.abs(cut.mean) ** 2) for cut in cuts])))


def mean_problem(
    cuts: Sequence[CutForces], law: ForceLaw = EDGES, exponents: Real = CONSTANT, reference: float = 1e-3
) -> tuple[ForceProblem, At]:
    """Return the problem of the mean forces, weighted by their misfit, and angles and runout, which have no effect.

    The misfit of a straight line over the feed exceeds the noise of a mean by far. Exponents are given.
    """
    problem = replace(evenly_weighted(cuts), top=0, law=law, reference=reference)
    still = At(np.zeros(len(cuts)), np.zeros(2), exponents)
    for _ in range(MEAN_ROUNDS):
        problem = problem.reweighted(still)
    return problem, still
