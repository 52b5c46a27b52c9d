"""Best linear approximation from periodic forces, classes of lines and tests over many lines."""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real

from ..frf.frf_matrix import Frf, FrfCovariance
from ..frf.quantities import frf_of_channels
from ..settings import PERIODS
from .cut_periods import SteadyPeriods, same_forces
from .noise import residual_covariance, split_covariance
from .noise_between_periods import covariance_of_periods


def excited_lines(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Find the lines (n_lines,) that any force of any realisation excites.

    The power of a force on an excited line is above 1e-3 of its largest power, and above 1e-2 of the largest of its
    neighbours.

    Parameters
    ----------
    periods
        Steady periods of one level.
    """
    power = np.zeros(len(periods.frequencies))
    for realisation in periods.realisations:
        own = np.abs(realisation.forces.mean(axis=0)) ** 2
        power = np.maximum(power, (own / np.maximum(own.max(axis=0), 1e-300)).max(axis=1))
    near = scipy.ndimage.maximum_filter1d(power, 2 * PERIODS.neighbours + 1, mode="nearest")
    return np.asarray((power > PERIODS.far_below) & (power > PERIODS.below * near))


def silent_classes(periods: SteadyPeriods, excited: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Sort the lines (n_lines,) that were not excited by the orders of distortion that reach them; no class is empty.

    The fundamental is the largest common divisor of the excited line numbers; lines at its multiples are harmonics. If
    only odd harmonics are excited, distortion of even order reaches even harmonics, and distortion of odd order odd
    harmonics; else both reach all harmonics. Second order ends at twice the highest line, third order at three times
    that line. Lines next to a multiple of a mains frequency are in no class.
    """
    numbers = periods.numbers
    if not excited.any():
        return {}
    base = int(np.gcd.reduce(numbers[excited]))
    low, high = int(numbers[excited].min()), int(numbers[excited].max())
    harmonic, odd = numbers % base == 0, (numbers // base) % 2 == 1
    between = (numbers > low) & (numbers < high) & ~excited
    second, third = "lines above the band, up to twice its end", "lines from twice to three times the band's end"
    above = {
        second: (numbers > high) & (numbers <= 2 * high),
        third: (numbers > 2 * high) & (numbers <= 3 * high),
    }
    if np.all(odd[excited]):
        classes = {
            "odd lines in the band": between & harmonic & odd,
            "even lines in the band": between & harmonic & ~odd,
        }
        above = {
            f"{name}, {parity}": lines & own
            for name, lines in above.items()
            for parity, own in (("odd", odd), ("even", ~odd))
        }
    else:
        classes = {"lines in the band": between & harmonic}
    classes["lines between the harmonics"] = between & ~harmonic
    classes |= {name: lines & harmonic & ~excited for name, lines in above.items()}
    clean = ~_near_mains(periods)
    return {name: lines & clean for name, lines in classes.items() if np.any(lines & clean)}


def _near_mains(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Return the lines less than one spacing away from a multiple of a mains frequency.

    Hum stays in step with many periods, and would count as distortion.
    """
    near = np.zeros(len(periods.frequencies), dtype=bool)
    for mains in PERIODS.mains:
        if periods.period * mains > 10:  # with wider spacing, too many lines would be lost
            away = np.abs(periods.frequencies - mains * np.maximum(1, np.rint(periods.frequencies / mains)))
            near |= away < 0.999 / periods.period
    return near


@dataclass(frozen=True)
class LinearApproximation:
    """FRF of the mean periods on the excited lines, with covariances of noise and distortion."""

    frf: Frf  # FRF with a covariance: of noise and distortion where there are enough realisations, else of noise alone
    # (n_lines, n_responses, n_responses); covariance of a realisation's mean residual ``X - G F`` by noise
    noise: Complex
    noise_freedom: int  # complex degrees of freedom of ``noise``
    # (n_lines, n_responses, n_responses); the same covariance by noise and stochastic nonlinear contributions; None:
    # too few realisations
    total: Complex | None
    total_freedom: int  # complex degrees of freedom of ``total``
    # (n_lines, n_excitations, n_excitations); ``conj(inv(F F^H))`` over the realisations: its product with ``noise`` or
    # ``total`` is a covariance of G
    excitation: Complex
    level: float  # N; root mean square of the forces
    power: Real  # (n_lines, n_responses); mean square of the response lines

    def distortion(self) -> Real | None:
        """Return the variance of the stochastic nonlinear contributions, (n_lines, n_responses).

        It may be below 0 by chance.

        None where there are too few realisations.
        """
        if self.total is None:
            return None
        return np.asarray(np.einsum("kpp->kp", self.total - self.noise).real)


def linear_approximation(periods: SteadyPeriods) -> LinearApproximation:
    """Estimate ``G = sum_m X_m F_m^H (sum_m F_m F_m^H)^-1`` from the mean spectra of M realisations.

    The covariance of the noise is ``[1, -G] C [1, -G]^H / P`` with the covariance C between P periods. The covariance
    of noise and stochastic nonlinear contributions is ``sum_m |X_m - G F_m|^2 / (M - n_excitations)`` (the robust
    method for the best linear approximation: Pintelon & Schoukens, System Identification, 2nd ed., sections 4.3 and
    7.3). A realisation that was played twice counts once.

    Parameters
    ----------
    periods
        Steady periods of one level.

    Raises
    ------
    InputError
        Fewer realisations than forces, or forces that are dependent at every line.
    """
    distinct = _distinct(periods)
    excited = excited_lines(distinct)
    forces, responses = (
        np.stack([spectra.mean(axis=0)[excited] for spectra in side], axis=2)
        for side in zip(*((each.forces, each.responses) for each in distinct.realisations), strict=True)
    )
    n_lines, m, n_realisations = forces.shape
    if n_realisations < m:
        raise InputError(
            f"{n_realisations} different realisations of {m} forces; give at least {m}, each with other phases, so "
            "that the forces are independent"
        )
    gram = forces @ forces.conj().transpose(0, 2, 1)
    valid = np.asarray(np.linalg.cond(gram) < 1e8)  # half of the digits of double precision
    if not valid.any():
        raise InputError(f"{m} forces are dependent at all {n_lines} excited lines; give them other phases")
    gram[~valid] = np.eye(m)
    inverse = np.linalg.inv(gram)
    values = responses @ forces.conj().transpose(0, 2, 1) @ inverse
    values[~valid] = 0.0
    # realisations played twice still add to the knowledge of the noise
    covariance, noise_freedom = covariance_of_periods(periods)
    inverse_periods = float(np.mean([1 / each.n_periods for each in distinct.realisations]))
    noise = residual_covariance(*split_covariance(covariance[excited], m), values) * inverse_periods
    total, total_freedom = None, n_realisations - m
    if total_freedom > 0:
        residual = responses - values @ forces
        total = residual @ residual.conj().transpose(0, 2, 1) / total_freedom
    excitation = inverse.conj()
    frf = frf_of_channels(
        periods.frequencies[excited],
        values,
        periods.responses,
        periods.excitations,
        valid,
        FrfCovariance(noise if total is None else _at_least(noise, total), excitation),
    )
    power = np.mean(np.abs(responses) ** 2, axis=2)
    return LinearApproximation(frf, noise, noise_freedom, total, total_freedom, excitation, periods.level, power)


def _distinct(periods: SteadyPeriods) -> SteadyPeriods:
    """Keep the first of realisations with the same single force; realisations of several forces differ by design."""
    if len(periods.excitations) > 1:
        return periods
    distinct = tuple(
        realisation
        for number, realisation in enumerate(periods.realisations)
        if not any(same_forces(realisation, earlier) for earlier in periods.realisations[:number])
    )
    return replace(periods, realisations=distinct)


def _at_least(noise: Complex, total: Complex) -> Complex:
    """Return the total covariance, or that of the noise on lines where the total is smaller by chance."""
    larger = np.einsum("kpp->k", total).real >= np.einsum("kpp->k", noise).real
    return np.asarray(np.where(larger[:, None, None], total, noise))


def ratio_p_values(ratio: Real, numerator: int, denominator: Real | int) -> Real:
    """Return the probability that noise gives ratios of mean squares of complex Gaussian values at least as large.

    The complex degrees of freedom of numerator and denominator count twice in the F distribution of real values.
    """
    return np.asarray(scipy.special.fdtrc(2 * numerator, 2 * np.asarray(denominator), np.maximum(ratio, 0.0)))


def combined_p_value(p_values: Real) -> float:
    """Combine independent p-values (n,): ``-2 sum ln p`` is chi-squared with 2 n degrees of freedom (Fisher 1925).

    Examples
    --------
    >>> round(combined_p_value(np.array([0.5, 0.5])), 3), combined_p_value(np.full(100, 0.01)) < 1e-50
    (0.597, True)
    """
    return float(scipy.special.chdtrc(2.0 * p_values.size, -2 * np.sum(np.log(np.maximum(p_values, 1e-300)))))


def significant_at(p_values: Real, rate: float = 0.05) -> NDArray[np.bool_]:
    """Return which of the p-values (n,) are significant at a false discovery rate.

    Benjamini & Hochberg, J. R. Stat. Soc. B 57, 289 (1995).

    Examples
    --------
    >>> significant_at(np.array([1e-6, 0.3, 0.04, 0.9])).tolist()
    [True, False, False, False]
    """
    order = np.argsort(p_values)
    below = np.flatnonzero(p_values[order] <= rate * np.arange(1, len(order) + 1) / len(order))
    significant = np.zeros(len(order), dtype=bool)
    if len(below):
        significant[order[: below[-1] + 1]] = True
    return significant
