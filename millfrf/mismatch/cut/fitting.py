"""Fit of coefficients, causes and spindle angle to recordings of a cut."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from millfrf.core import Real

from ..inference.numerics import Limits, bounded_step, descend
from ..physics.protocol import Parameter
from .hypothesis import CutHypothesis, MeasuredCut
from .motion import SpindleLaw
from .physics import CutPhysics

ANGLE_STEP = 0.01  # unit of the numbers of a spindle law in a fit: change of the angle at the middle or the ends, rad

MAX_DEVIATION = 40.0  # bound of the deviation of a coefficient, in laboratory standard deviations


@dataclass(frozen=True)
class FreeNumbers:
    """Coordinates of a fit: deviations of coefficients, numbers of freed causes, and three for each spindle law."""

    cut: MeasuredCut
    start: CutHypothesis  # hypothesis at the start of the fit; numbers that are not free keep its values
    freed: tuple[str, ...]  # names of the causes whose numbers are free
    refit: bool  # whether the coefficients are free

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the freed causes, one after the other."""
        process = self.cut.belief.process
        return tuple(parameter for name in self.freed for parameter in self.start.cause(name).parameters(process))

    @property
    def coefficients(self) -> int:
        """Number of free deviations: 6 or 0."""
        return 6 if self.refit else 0

    @property
    def physical(self) -> int:
        """Number of coordinates before those of the spindle."""
        return self.coefficients + len(self.parameters)

    @cached_property
    def bounds(self) -> tuple[Real, Real]:
        """Lowest and highest coordinates, (n,) each."""
        steps = np.array([parameter.unit_step for parameter in self.parameters])
        spindle = np.full(3 * len(self.start.laws), np.inf)
        lowest = self.cut.belief.lowest[: self.coefficients]
        low = np.array([parameter.low for parameter in self.parameters]) / steps
        high = np.array([parameter.high for parameter in self.parameters]) / steps
        return (
            np.concatenate([lowest, low, -spindle]),
            np.concatenate([np.full(self.coefficients, MAX_DEVIATION), high, spindle]),
        )

    @cached_property
    def begin(self) -> Real:
        """Coordinates of the start, within the bounds, (n,)."""
        values = [float(value) for name in self.freed for value in self.start.values(name)]
        fitted = [parameter.to_fit(value) for parameter, value in zip(self.parameters, values, strict=True)]
        spindle = np.zeros(3 * len(self.start.laws))
        parts = [self.start.deviations[: self.coefficients], np.array(fitted), spindle]
        return np.asarray(np.clip(np.concatenate(parts), *self.bounds))

    def hypothesis(self, coordinates: Real) -> CutHypothesis:
        """Return the hypothesis at these coordinates (n,)."""
        result = replace(self.start, deviations=coordinates[:6]) if self.refit else self.start
        numbers = coordinates[self.coefficients : self.physical]
        values = [parameter.from_fit(float(x)) for parameter, x in zip(self.parameters, numbers, strict=True)]
        for name in self.freed:
            count = len(self.start.values(name))
            result, values = result.with_values(name, np.array(values[:count])), values[count:]
        spindle_changes = coordinates[self.physical :].reshape(-1, 3) * self._spindle_units
        laws = [
            SpindleLaw(law.middle, law.angle + float(by[0]), law.speed + float(by[1]), law.change + float(by[2]))
            for law, by in zip(self.start.laws, spindle_changes, strict=True)
        ]
        return replace(result, laws=tuple(laws))

    def covariance(self, matrix: Real) -> Real:
        """Return the covariance of the deviations, followed by the numbers of causes in SI.

        ``matrix`` is the normal matrix, (n, n).
        """
        spread = np.linalg.pinv(matrix, hermitian=True)[: self.physical, : self.physical]
        units = np.array([1.0] * self.coefficients + [parameter.unit_step for parameter in self.parameters])
        return np.asarray(spread * np.outer(units, units), dtype=np.float64)

    @cached_property
    def _spindle_units(self) -> Real:
        """Return the units of angle, speed and change of the speed in each recording, (n_recordings, 3)."""
        spans = [len(spectrum.recording.force) / spectrum.recording.rate / 2 for spectrum in self.cut.spectra]
        return np.array([[ANGLE_STEP, ANGLE_STEP / span, 2 * ANGLE_STEP / span**2] for span in spans])


DIFFERENCE = 0.05  # step of the finite differences, in units of the fit

# stopping criteria; in these units the cost is nearly quadratic: after a step without gain, damping is increased
# instead of shortening the step
LIMITS = Limits(max_steps=15, tolerance=0.1, max_idle=1, max_lengths=1, max_damping=10.0, lengthen=False)

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
        """Misfit and deviation, which a fit minimises."""
        return self.misfit + self.deviation

    @property
    def score(self) -> float:
        """Misfit, deviation and price together: less is better."""
        return self.cost + self.price

    def covariance_of(self, name: str) -> Real:
        """Return the covariance of the numbers of one freed cause, (n_numbers, n_numbers), SI."""
        counts = [len(self.hypothesis.values(cause)) for cause in self.freed]
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
    """Minimise ``2 sum |W r|^2 + |u|^2`` over coefficients, numbers of freed causes and spindle angle."""
    free = FreeNumbers(cut, start, tuple(freed), refit)
    problem = _Problem(free, part)
    end = descend(problem, problem.at(free.begin), LIMITS)
    hypothesis = free.hypothesis(end.state.coordinates)
    blocks = tuple(cut.block_misfits(k, hypothesis) for k in range(len(cut.spectra)))
    count = sum(2 * spectra.measured[part].size for spectra in cut.spectra)
    return CutFit(
        hypothesis,
        tuple(freed),
        float(sum(block[part].sum() for block in blocks)),
        float(np.sum(hypothesis.deviations**2)),
        len(free.parameters) * float(np.log(count)),
        free.covariance(end.matrix),
        blocks,
    )


@dataclass(frozen=True)
class _Point:
    """Coordinates (n,) of a fit, and the residual (m,) there with the deviations."""

    coordinates: Real
    residual: Real


@dataclass(frozen=True)
class _Problem:
    """Sum of squares for the descent: see :class:`millfrf.mismatch.inference.numerics.Problem`."""

    free: FreeNumbers
    part: slice

    def at(self, coordinates: Real) -> _Point:
        """Return the point at these coordinates."""
        hypothesis = self.free.hypothesis(coordinates)
        rows = []
        for k in range(len(self.free.cut.spectra)):
            residual = np.sqrt(2) * self.free.cut.residual(k, hypothesis)[self.part].ravel()
            rows += [residual.real, residual.imag]
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


ANGLES = 40  # number of tested spindle angles in a pitch


def started(cut: MeasuredCut, acting: Sequence[tuple[CutPhysics, Real]]) -> CutHypothesis:
    """Return the hypothesis with the spindle angles for which the force of the cutting file leaves the least residual.

    A factor on the force is free, as an error of the coefficients does not change the angle.
    """
    process = cut.belief.process
    revolutions = process.teeth if process.runout > 0 else 1
    angles = np.arange(ANGLES * revolutions) * 2 * np.pi / (process.teeth * ANGLES)
    hypothesis = CutHypothesis(np.zeros(6), tuple(acting), tuple(spectrum.recording.law for spectrum in cut.spectra))
    for k in range(len(cut.spectra)):
        rotated = [hypothesis.with_angle(k, float(angle)) for angle in angles]
        hypothesis = rotated[int(np.argmin([_residual_power(cut, k, candidate) for candidate in rotated]))]
    return hypothesis


def fit_with_tooth_numbers(cut: MeasuredCut, start: CutHypothesis, freed: Sequence[str]) -> CutFit:
    """Fit to all recordings, with the teeth of each recording numbered as in the first recording.

    A recording does not show which tooth is tooth 0. Therefore causes that distinguish teeth are first fitted to the
    first recording. Each other recording is then rotated by whole pitches until it agrees with this fit. Finally all
    recordings are fitted together.
    """
    teeth = cut.belief.process.teeth
    if teeth == 1 or len(cut.spectra) == 1 or not freed:
        return fit_cut(cut, start, freed)
    first = CutHypothesis(start.deviations, start.acting, start.laws[:1])
    first_fit = fit_cut(cut.only(0), first, freed).hypothesis
    hypothesis = CutHypothesis(first_fit.deviations, first_fit.acting, first_fit.laws + start.laws[1:])
    for k in range(1, len(cut.spectra)):
        angle = hypothesis.laws[k].angle
        rotated = [hypothesis.with_angle(k, angle + turn * 2 * np.pi / teeth) for turn in range(teeth)]
        misfits = [float(cut.block_misfits(k, candidate).sum()) for candidate in rotated]
        hypothesis = rotated[int(np.argmin(misfits))]
    return fit_cut(cut, hypothesis, freed)


def _residual_power(cut: MeasuredCut, number: int, hypothesis: CutHypothesis) -> float:
    """Return the residual power of one recording, N^2, with the factor on the computed force that minimises it."""
    predicted, measured = cut.predicted(number, hypothesis), cut.spectra[number].measured
    power = float(np.sum(np.abs(predicted) ** 2))
    gain = max(float(np.real(np.vdot(predicted, measured))) / max(power, 1e-300), 0.0)
    return float(np.sum(np.abs(measured - gain * predicted) ** 2))
