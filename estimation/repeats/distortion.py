"""Nonlinear distortion without a model, and homogeneity of the FRF over the level of the forces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real

from ..settings import PERIODS
from .cut_periods import SteadyPeriods, same_forces
from .linear_approximation import (
    LinearApproximation,
    combined_p_value,
    excited_lines,
    linear_approximation,
    ratio_p_values,
    significant_at,
    silent_classes,
)
from .noise import residual_covariance, split_covariance
from .noise_between_periods import covariance_of_periods


@dataclass(frozen=True)
class LineClass:
    """Distortion of the responses on one class of lines."""

    name: str  # describes the lines
    n_lines: int
    # (n_responses,); root mean square on these lines over that on excited lines, noise subtracted; 0 where noise
    # explains all
    level: Real
    noise: Real  # (n_responses,); noise of the mean periods in the same scale
    # (n_excitations,); level of the forces on these lines over that on excited lines: a shaker distorts, too
    force: Real
    p_values: Real  # (n_responses,); probability of a level at least as large by noise alone


@dataclass(frozen=True)
class Distortion:
    """Nonlinear distortion of one level."""

    responses: tuple[str, ...]  # names
    classes: tuple[LineClass, ...]  # of lines that were not excited
    # (n_responses,); stochastic nonlinear contributions on excited lines over the response there; None: one realisation
    stochastic: Real | None
    # (n_responses,); probability of differences between realisations at least as large by noise alone
    stochastic_p_values: Real | None
    level: float  # N; root mean square of the forces

    def sentences(self) -> tuple[str, ...]:
        """Describe each significant distortion in one sentence, with the strongest response of each class."""
        sentences = []
        for lines in self.classes:
            strongest = _strongest(lines.level, lines.p_values)
            if strongest is not None:
                sentences.append(
                    f"distortion at {lines.name}: {_decibels(lines.level[strongest])} of {self.responses[strongest]} "
                    f"(noise {_decibels(lines.noise[strongest])}, force itself {_decibels(float(lines.force.max()))})"
                )
        if self.stochastic is not None and self.stochastic_p_values is not None:
            strongest = _strongest(self.stochastic, self.stochastic_p_values)
            if strongest is not None:
                share = _decibels(self.stochastic[strongest])
                sentences.append(f"realisations differ beyond noise: {share} of {self.responses[strongest]}")
        return tuple(sentences)


def _strongest(level: Real, p_values: Real) -> int | None:
    """Return the index of the response with the largest significant level; None where none is significant."""
    significant = np.flatnonzero((p_values < PERIODS.significant) & (level > 0))
    return int(significant[np.argmax(level[significant])]) if len(significant) else None


def _decibels(share: float) -> str:
    return "none" if share <= 0 else f"{20 * np.log10(share):.0f} dB"


def distortion(periods: SteadyPeriods) -> Distortion:
    """Measure the distortion of one level on the lines that were not excited, and between realisations.

    Between excited lines, the response to the distorted part of the forces is subtracted with an FRF G that is
    interpolated linearly: ``D = X - G F``. Above the band there is no G, so that the level of the forces is reported
    together with the level of the responses. Each line is compared with the noise between periods by an F test;
    Fisher's method combines the lines (Pintelon & Schoukens, System Identification, 2nd ed., section 4.3.2). Hum in
    step with the periods counts as distortion.

    Parameters
    ----------
    periods
        Steady periods of one level. As many realisations as forces are needed, one more for the stochastic part.
    """
    linear = linear_approximation(periods)
    excited = excited_lines(periods)
    covariance, freedom = covariance_of_periods(periods)
    through, error = _interpolated_frf(linear, periods)
    size = np.sqrt(np.maximum(linear.power.mean(axis=0), 1e-300))  # a dead channel has no power
    driven = [np.mean(np.abs(each.forces.mean(axis=0)[excited]) ** 2, axis=0) for each in periods.realisations]
    drive = np.sqrt(np.maximum(np.mean(driven, axis=0), 1e-300))
    parts = split_covariance(covariance, len(periods.excitations))
    noise = np.einsum("kpp->kp", residual_covariance(*parts, through)).real
    force_noise = np.einsum("kqq->kq", parts[1]).real
    classes = []
    for name, lines in silent_classes(periods, excited).items():
        powers = _class_powers(periods, lines, through[lines], error[lines], noise[lines], force_noise[lines])
        p_values = ratio_p_values(powers.ratio, len(periods.realisations), freedom)
        classes.append(
            LineClass(
                name,
                int(lines.sum()),
                np.sqrt(np.maximum(powers.distortion, 0.0)) / size,
                np.sqrt(powers.noise) / size,
                np.sqrt(powers.forces) / drive,
                _combined(p_values),
            )
        )
    names = tuple(channel.name for channel in periods.responses)
    return Distortion(names, tuple(classes), *_stochastic(linear), linear.level)


def _combined(p_values: Real) -> Real:
    """Combine the p-values of all lines (n_lines, n_responses) to one for each response."""
    return np.array([combined_p_value(column) for column in p_values.T])


@dataclass(frozen=True)
class _ClassPowers:
    ratio: Real  # power of the residual over power of the noise, (n_lines, n_responses)
    distortion: Real  # mean power of the residual minus power of the noise, (n_responses,)
    forces: Real  # (n_excitations,)
    noise: Real  # (n_responses,)


def _class_powers(
    periods: SteadyPeriods, lines: NDArray[np.bool_], through: Complex, error: Real, noise: Real, force_noise: Real
) -> _ClassPowers:
    """Compute the mean powers over the realisations, on the lines of one class."""
    sums: list[Real] = []
    for realisation in periods.realisations:
        force = realisation.forces.mean(axis=0)[lines]
        residual = realisation.responses.mean(axis=0)[lines] - np.einsum("kpq,kq->kp", through, force)
        # the error of the interpolated FRF acts on the force without its noise, which is in the variance already
        size = np.sqrt(np.maximum(np.abs(force) ** 2 - force_noise / realisation.n_periods, 0.0))
        variance = noise / realisation.n_periods + np.einsum("kpq,kq->kp", error, size) ** 2
        powers = (
            np.abs(residual) ** 2 / np.maximum(variance, 1e-300),
            np.mean(np.abs(residual) ** 2 - variance, axis=0),
            np.mean(np.abs(force) ** 2, axis=0),
            np.mean(variance, axis=0),
        )
        sums = [total + power for total, power in zip(sums, powers, strict=True)] if sums else list(powers)
    return _ClassPowers(*(total / len(periods.realisations) for total in sums))


def _interpolated_frf(linear: LinearApproximation, periods: SteadyPeriods) -> tuple[Complex, Real]:
    """Interpolate the FRF linearly to all lines, 0 outside the band; also return a bound of the error."""
    own, values = linear.frf.frequencies[linear.frf.valid], linear.frf.values[linear.frf.valid]
    bend = np.zeros_like(values)
    # constant curvature deviates midway by at most half of what a line deviates from the mean of its neighbours
    if len(own) > 2:
        bend[1:-1] = (values[1:-1] - (values[:-2] + values[2:]) / 2) / 2
        bend[0], bend[-1] = bend[1], bend[-2]
    f = periods.frequencies
    shape = (len(f), *values.shape[1:])
    through, error = np.zeros(shape, dtype=complex), np.zeros(shape)
    inside = (f >= own[0]) & (f <= own[-1])
    for p, q in np.ndindex(values.shape[1:]):
        through[inside, p, q] = np.interp(f[inside], own, values[:, p, q])
        error[inside, p, q] = np.interp(f[inside], own, np.abs(bend[:, p, q]))
    return through, error


def _stochastic(linear: LinearApproximation) -> tuple[Real | None, Real | None]:
    """Return the share of stochastic nonlinear contributions in each response, and its p-value."""
    variance = linear.distortion()
    if variance is None or linear.total is None:
        return None, None
    noise = np.einsum("kpp->kp", linear.noise).real
    ratio = np.einsum("kpp->kp", linear.total).real / np.maximum(noise, 1e-300)
    p_values = ratio_p_values(ratio, linear.total_freedom, linear.noise_freedom)
    share = np.sqrt(np.maximum(variance.mean(axis=0), 0.0) / np.maximum(linear.power.mean(axis=0), 1e-300))
    return share, _combined(p_values)


@dataclass(frozen=True)
class Homogeneity:
    """Comparison of the FRFs of two levels."""

    frequencies: Real  # (n_lines,), Hz; lines that both levels excite
    first: Complex  # (n_lines, n_responses, n_excitations); FRF at the first level
    second: Complex
    levels: tuple[float, float]  # N; root mean square of the forces at either level
    # (n_lines, n_responses); probability of a difference at least as large by the uncertainty of both FRFs
    line_p_values: Real
    p_values: Real  # (n_responses,); p-value of all lines together
    # (n_lines, n_responses); lines that differ significantly, at a false discovery rate of 5 %
    differing: NDArray[np.bool_]
    change: Real  # (n_responses,); root mean square difference over root mean square FRF, uncertainty subtracted
    largest: Real  # (n_responses,), Hz; line of the largest difference
    statement: str  # one sentence on the uncertainty that was counted


def homogeneity(first: SteadyPeriods, second: SteadyPeriods) -> Homogeneity:
    """Test whether two levels have the same FRF.

    At each line and response ``d^H (C_1 + C_2)^-1 d / m ~ F(2 m, 2 v)`` with the difference d of the m entries of a
    row, the covariances C_1 and C_2 of both FRFs, and v degrees of freedom (Welch, Biometrika 34, 28, 1947). Where both
    levels play the same realisation, C_1 and C_2 are those of noise alone, because the stochastic contributions of a
    homogeneous structure are then the same. Else they include the stochastic contributions, if there are enough
    realisations to estimate them.

    Parameters
    ----------
    first, second
        Steady periods of the two levels, of the same channels, rate and period.

    Raises
    ------
    InputError
        Different channels, or no line that both excite.
    """
    if (first.excitations, first.responses) != (second.excitations, second.responses):
        raise InputError("levels of different channels cannot be compared; give the same channels in the same order")
    low, high = linear_approximation(first), linear_approximation(second)
    same = len(first.realisations) == len(second.realisations) and all(
        same_forces(a, b) for a, b in zip(first.realisations, second.realisations, strict=True)
    )
    low_lines, high_lines = _shared_lines(low, high)
    frequencies = low.frf.frequencies[low_lines]
    low_values, high_values = low.frf.values[low_lines], high.frf.values[high_lines]
    delta = high_values - low_values
    line_p, variance = _compared(delta, [_uncertainty(low, low_lines, same), _uncertainty(high, high_lines, same)])
    difference = np.sum(np.abs(delta) ** 2, axis=2)
    energy = np.maximum(np.sum(np.abs(low_values) ** 2, axis=(0, 2)), 1e-300)
    if same:
        uncertainty = "noise alone, because both play the same realisation"
    elif low.total is None or high.total is None:
        uncertainty = "noise alone: one realisation does not show stochastic contributions, which count as change"
    else:
        uncertainty = "noise and of stochastic contributions between realisations"
    return Homogeneity(
        frequencies,
        low_values,
        high_values,
        (low.level, high.level),
        line_p,
        _combined(line_p),
        np.stack([significant_at(column) for column in line_p.T], axis=1),
        np.sqrt(np.maximum(np.sum(difference - variance, axis=0), 0.0) / energy),
        frequencies[np.argmax(difference, axis=0)],
        f"{len(frequencies)} lines that both levels excite; the uncertainty is that of {uncertainty}.",
    )


def _compared(delta: Complex, uncertainties: list[tuple[Complex, Complex, int]]) -> tuple[Real, Real]:
    """Return p-value and variance (n_lines, n_responses) of differences (n_lines, n_responses, n_excitations)."""
    m = delta.shape[2]
    p_values, variance = np.empty(delta.shape[:2]), np.empty(delta.shape[:2])
    for p in range(delta.shape[1]):
        first, second = (own[:, p, p].real[:, None, None] * excitation for own, excitation, _ in uncertainties)
        traces = [np.einsum("kqq->k", row).real for row in (first, second)]
        # degrees of freedom of a sum of variances by Welch and Satterthwaite
        freedom = sum(traces) ** 2 / np.maximum(
            sum(trace**2 / own for trace, (_, _, own) in zip(traces, uncertainties, strict=True)), 1e-300
        )
        weighted = np.linalg.solve(first + second, delta[:, p, :, None])[:, :, 0]
        ratio = np.einsum("kq,kq->k", delta[:, p].conj(), weighted).real / m
        p_values[:, p], variance[:, p] = ratio_p_values(ratio, m, freedom), sum(traces)
    return p_values, variance


def _shared_lines(first: LinearApproximation, second: LinearApproximation) -> tuple[Index, Index]:
    """Return the valid lines of equal frequency, as indices into either approximation."""
    a, b = first.frf.frequencies, second.frf.frequencies
    nearest = np.clip(np.searchsorted(b, a - 1e-9 * a), 0, len(b) - 1)
    shared = (np.abs(b[nearest] - a) < 1e-6 * a) & first.frf.valid & second.frf.valid[nearest]
    if not shared.any():
        raise InputError("the levels excite no line in common; play the same lines at both")
    return np.flatnonzero(shared), nearest[shared]


def _uncertainty(linear: LinearApproximation, lines: Index, same: bool) -> tuple[Complex, Complex, int]:
    """Return the covariance of the residual, the factor of the excitation, and the degrees of freedom."""
    if same or linear.total is None:
        return linear.noise[lines], linear.excitation[lines], linear.noise_freedom
    return linear.total[lines], linear.excitation[lines], linear.total_freedom
