"""Fit of coefficients, causes and the angle of the spindle to recordings of a cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from millfrf.core import Real

from ..inference.descent import Limits, bounded_step, descend
from ..physics.protocol import Parameter
from .hypothesis import CutHypothesis, MeasuredCut
from .physics import CutPhysics
from .spindle_law import SpindleLaw

TURN = 0.01
"""Unit of the spindle's angle in a fit, rad, at the middle or at the ends of the recording."""

FAR = 40.0
"""Bound of a coefficient's deviation, in a laboratory's standard deviations."""


@dataclass(frozen=True)
class FreeNumbers:
    """Coordinates of a fit: deviations of coefficients, numbers of freed causes, and three of each spindle law.

    Parameters
    ----------
    cut
        Recordings of the cut.
    start
        Hypothesis to begin with; what is not free stays as it is there.
    freed
        Names of the causes whose numbers are free.
    refit
        Whether the coefficients are free.
    """

    cut: MeasuredCut
    start: CutHypothesis
    freed: tuple[str, ...]
    refit: bool

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the freed causes, one after the other."""
        process = self.cut.belief.process
        return tuple(one for name in self.freed for one in self.start.cause(name).parameters(process))

    @property
    def coefficients(self) -> int:
        """Number of deviations that are free: 6 or 0."""
        return 6 if self.refit else 0

    @property
    def physical(self) -> int:
        """Number of coordinates that are not the spindle's; they come first."""
        return self.coefficients + len(self.parameters)

    @cached_property
    def bounds(self) -> tuple[Real, Real]:
        """Lowest and highest coordinates, (n,) each."""
        steps = np.array([one.unit_step for one in self.parameters])
        spindle = np.full(3 * len(self.start.laws), np.inf)
        lowest = self.cut.belief.lowest[: self.coefficients]
        low = np.array([one.low for one in self.parameters]) / steps
        high = np.array([one.high for one in self.parameters]) / steps
        return (
            np.concatenate([lowest, low, -spindle]),
            np.concatenate([np.full(self.coefficients, FAR), high, spindle]),
        )

    @cached_property
    def begin(self) -> Real:
        """Coordinates of the hypothesis to begin with, within the bounds, (n,)."""
        values = [float(value) for name in self.freed for value in self.start.values(name)]
        fitted = [one.to_fit(value) for one, value in zip(self.parameters, values, strict=True)]
        spindle = np.zeros(3 * len(self.start.laws))
        parts = [self.start.deviations[: self.coefficients], np.array(fitted), spindle]
        return np.asarray(np.clip(np.concatenate(parts), *self.bounds))

    def hypothesis(self, coordinates: Real) -> CutHypothesis:
        """The hypothesis at a point.

        Parameters
        ----------
        coordinates : (n,)
            Coordinates of the point.
        """
        found = replace(self.start, deviations=coordinates[:6]) if self.refit else self.start
        numbers = coordinates[self.coefficients : self.physical]
        values = [one.from_fit(float(x)) for one, x in zip(self.parameters, numbers, strict=True)]
        for name in self.freed:
            count = len(self.start.values(name))
            found, values = found.with_values(name, np.array(values[:count])), values[count:]
        turns = coordinates[self.physical :].reshape(-1, 3) * self._spindle_units
        laws = [
            SpindleLaw(law.middle, law.angle + float(by[0]), law.speed + float(by[1]), law.change + float(by[2]))
            for law, by in zip(self.start.laws, turns, strict=True)
        ]
        return replace(found, laws=tuple(laws))

    def covariance(self, matrix: Real) -> Real:
        """Covariance of deviations, then of the causes' numbers in SI, the spindle's angle taken into account.

        Parameters
        ----------
        matrix : (n, n)
            Normal matrix of the coordinates.
        """
        spread = np.linalg.pinv(matrix, hermitian=True)[: self.physical, : self.physical]
        units = np.array([1.0] * self.coefficients + [one.unit_step for one in self.parameters])
        return np.asarray(spread * np.outer(units, units), dtype=np.float64)

    @cached_property
    def _spindle_units(self) -> Real:
        """Units of angle, speed and its change in each recording, (n_recordings, 3)."""
        spans = [len(one.recording.force) / one.recording.rate / 2 for one in self.cut.spectra]
        return np.array([[TURN, TURN / span, 2 * TURN / span**2] for span in spans])


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
    """The sum of squares as the descent wants it: see :class:`millfrf.mismatch.inference.descent.Problem`."""

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


ANGLES = 40
"""Number of spindle angles that are tried in a pitch."""


def started(cut: MeasuredCut, acting: Sequence[tuple[CutPhysics, Real]]) -> CutHypothesis:
    """The spindle's angle at which the force, computed as the file says, leaves least of each recording.

    One factor on the force is free: an error of the coefficients does not move the angle.

    Parameters
    ----------
    cut
        Recordings of the cut.
    acting
        Every cause with its numbers (n_numbers,) in SI, as the cutting file states them.
    """
    process = cut.belief.process
    turns = process.teeth if process.runout > 0 else 1
    angles = np.arange(ANGLES * turns) * 2 * np.pi / (process.teeth * ANGLES)
    begun = CutHypothesis(np.zeros(6), tuple(acting), tuple(one.recording.law for one in cut.spectra))
    for k in range(len(cut.spectra)):
        turned = [begun.with_angle(k, float(angle)) for angle in angles]
        begun = turned[int(np.argmin([_left(cut, k, one) for one in turned]))]
    return begun


def fit_turned(cut: MeasuredCut, start: CutHypothesis, freed: Sequence[str], *, part: slice = ALL) -> CutFit:
    """:func:`fit_cut`, with the teeth of every further recording numbered as in the first.

    A recording does not say which tooth is tooth 0. Causes that tell teeth apart are fitted to the first recording.
    The other recordings are turned by whole pitches until they agree with it. Then all are fitted together.

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
    """
    teeth = cut.belief.process.teeth
    if teeth == 1 or len(cut.spectra) == 1 or not freed:
        return fit_cut(cut, start, freed, part=part)
    first = CutHypothesis(start.deviations, start.acting, start.laws[:1])
    alone = fit_cut(cut.only(0), first, freed, part=part).hypothesis
    found = CutHypothesis(alone.deviations, alone.acting, alone.laws + start.laws[1:])
    for k in range(1, len(cut.spectra)):
        angle = found.laws[k].angle
        turned = [found.with_angle(k, angle + turn * 2 * np.pi / teeth) for turn in range(teeth)]
        left = [float(cut.block_misfits(k, one)[part].sum()) for one in turned]
        found = turned[int(np.argmin(left))]
    return fit_cut(cut, found, freed, part=part)


def _left(cut: MeasuredCut, number: int, hypothesis: CutHypothesis) -> float:
    """Power that is left of one recording, with the best factor on the force, N^2."""
    predicted, measured = cut.predicted(number, hypothesis), cut.spectra[number].measured
    power = float(np.sum(np.abs(predicted) ** 2))
    gain = max(float(np.real(np.vdot(predicted, measured))) / max(power, 1e-300), 0.0)
    return float(np.sum(np.abs(measured - gain * predicted) ** 2))
