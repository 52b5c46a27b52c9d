"""`fit_cut`: coefficients, causes and the spindle's angle fitted to recordings of a cut."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....inference import Limits, bounded_step, descend
from .free_numbers import FreeNumbers
from .hypothesis import CutHypothesis
from .measured_cut import MeasuredCut

Real = NDArray[np.float64]

DIFFERENCE = 0.05
"""Step of the finite differences, in units of the fit."""

LIMITS = Limits(most=15, tolerance=0.1, idle=1, tries=1, most_damping=10.0, lengthens=False)
"""When a fit ends. In its units the cost is close to quadratic: a step that does not gain is damped, not shortened."""

ALL = slice(None)


@dataclass(frozen=True)
class CutFit:
    """A hypothesis that was fitted to a cut, with its cost.

    Parameters
    ----------
    hypothesis
        Hypothesis with the fitted numbers.
    freed
        Names of the causes that were fitted.
    misfit
        ``2 sum |W r|^2`` over the blocks that were fitted.
    deviation
        ``|u|^2`` of the coefficients' deviations u.
    price
        ``n ln N`` of the causes' n numbers, where N counts the real data.
    covariance : (n, n)
        Covariance of the deviations (where they are free), then of the freed causes' numbers in SI.
    block_misfits
        ``2 sum |W r|^2`` of every block, (n_blocks,) for each recording.
    """

    hypothesis: CutHypothesis
    freed: tuple[str, ...]
    misfit: float
    deviation: float
    price: float
    covariance: Real
    block_misfits: tuple[Real, ...]

    @property
    def cost(self) -> float:
        """Misfit and deviation: what a fit minimises."""
        return self.misfit + self.deviation

    @property
    def score(self) -> float:
        """Misfit, deviation and price together: less is better."""
        return self.cost + self.price

    def covariance_of(self, name: str) -> Real:
        """Covariance of one freed cause's numbers, (n_numbers, n_numbers), SI.

        Parameters
        ----------
        name
            Name of the cause.
        """
        counts = [len(self.hypothesis.values(one)) for one in self.freed]
        at = len(self.covariance) - sum(counts[self.freed.index(name) :])
        block = slice(at, at + len(self.hypothesis.values(name)))
        return self.covariance[block, block]


def fit_cut(
    cut: MeasuredCut,
    start: CutHypothesis,
    freed: Sequence[str] = (),
    *,
    part: slice = ALL,
    refit: bool = True,
) -> CutFit:
    """Minimise ``2 sum |W r|^2 + |u|^2`` over the coefficients, the freed causes' numbers and the spindle's angle.

    Parameters
    ----------
    cut
        Recordings with their noise.
    start
        Hypothesis to begin with.
    freed
        Names of the causes whose numbers are fitted.
    part
        Blocks that are fitted.
    refit
        Whether the coefficients may move.
    """
    free = FreeNumbers(cut, start, tuple(freed), refit)
    problem = _Problem(free, part)
    end = descend(problem, problem.at(free.begin), LIMITS)
    found = free.hypothesis(end.state.coordinates)
    blocks = tuple(cut.block_misfits(k, found) for k in range(len(cut.spectra)))
    count = sum(2 * spectra.measured[part].size for spectra in cut.spectra)
    return CutFit(
        found,
        tuple(freed),
        float(sum(one[part].sum() for one in blocks)),
        float(np.sum(found.deviations**2)),
        len(free.parameters) * float(np.log(count)),
        free.covariance(end.matrix),
        blocks,
    )


@dataclass(frozen=True)
class _Point:
    """Coordinates (n,) of a fit, and the residual (m,) there, the deviations with it."""

    coordinates: Real
    residual: Real


@dataclass(frozen=True)
class _Problem:
    """The sum of squares as the descent wants it: see :class:`mismatch.inference.Problem`."""

    free: FreeNumbers
    part: slice

    def at(self, coordinates: Real) -> _Point:
        """The point at these coordinates."""
        hypothesis = self.free.hypothesis(coordinates)
        rows = []
        for k in range(len(self.free.cut.spectra)):
            rest = np.sqrt(2) * self.free.cut.residual(k, hypothesis)[self.part].ravel()
            rows += [rest.real, rest.imag]
        if self.free.refit:
            rows.append(hypothesis.deviations)
        return _Point(coordinates, np.concatenate(rows))

    def cost(self, state: _Point) -> float:
        return float(state.residual @ state.residual)

    def normal_equations(self, state: _Point) -> tuple[Real, Real]:
        x = state.coordinates
        steps = np.where(x + DIFFERENCE > self.free.bounds[1], -DIFFERENCE, DIFFERENCE)
        columns = [
            (self.at(x + step * axis).residual - state.residual) / step
            for step, axis in zip(steps, np.eye(len(x)), strict=True)
        ]
        slopes = np.stack(columns)
        return slopes @ slopes.T, -slopes @ state.residual

    def step(self, state: _Point, matrix: Real, gradient: Real) -> Real:
        return bounded_step(state.coordinates, matrix, gradient, *self.free.bounds)

    def moved(self, state: _Point, step: Real) -> _Point:
        return self.at(np.clip(state.coordinates + step, *self.free.bounds))

    def settled(self, state: _Point) -> _Point:
        return state
