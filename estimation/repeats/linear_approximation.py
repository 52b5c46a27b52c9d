"""Best linear approximation from periodic forces, classes of lines and tests over many lines."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real

from ..frf.frf_matrix import Frf, FrfCovariance
from ..frf.quantities import frf_quantity
from .cut_periods import SteadyPeriods, same_forces
from .noise import parted, residual_covariance
from .noise_between_periods import covariance_of_periods

FAR_BELOW, BELOW = 1e-3, 1e-2
"""Power of a line that was not excited: over the largest of all, and over the largest of the neighbours."""

NEIGHBOURS = 10
"""Lines to either side that a line is compared with."""

MAINS = (50.0, 60.0)
"""Hz; their multiples are no lines that show distortion, because hum stays in step with many a period."""

INSIDE_ODD, INSIDE_EVEN, INSIDE = "odd lines in the band", "even lines in the band", "lines in the band"
BETWEEN = "lines between the harmonics"
SECOND, THIRD = "lines above the band, up to twice its end", "lines from twice to three times the band's end"


def excited_lines(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Which lines were excited, (n_lines,): none far below the largest force or far below its neighbours.

    Parameters
    ----------
    periods
        Steady periods; a line that any realisation and any force excites counts.
    """
    power = np.zeros(len(periods.frequencies))
    for one in periods.realisations:
        own = np.abs(one.forces.mean(axis=0)) ** 2
        power = np.maximum(power, (own / np.maximum(own.max(axis=0), 1e-300)).max(axis=1))
    near = scipy.ndimage.maximum_filter1d(power, 2 * NEIGHBOURS + 1, mode="nearest")
    return np.asarray((power > FAR_BELOW) & (power > BELOW * near))


def silent_classes(periods: SteadyPeriods, excited: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Lines that were not excited, by what can reach them.

    Harmonics are counted in the largest common divisor of the excited line numbers. Distortion of even order reaches
    even harmonics, and of odd order odd ones, where only odd ones are excited; else both orders reach every line.
    Second order ends at twice the highest line, third order at three times. Lines beside multiples of a mains frequency
    are in no class.

    Parameters
    ----------
    periods
        Steady periods whose forces were excited at these lines.
    excited : (n_lines,)
        Lines that were excited.

    Returns
    -------
    dict
        Name of the class, and its lines, (n_lines,); empty classes are left out.
    """
    numbers = periods.numbers
    if not excited.any():
        return {}
    base = int(np.gcd.reduce(numbers[excited]))
    low, high = int(numbers[excited].min()), int(numbers[excited].max())
    harmonic, odd = numbers % base == 0, (numbers // base) % 2 == 1
    inside = (numbers > low) & (numbers < high) & ~excited
    if np.all(odd[excited]):
        classes = {INSIDE_ODD: inside & harmonic & odd, INSIDE_EVEN: inside & harmonic & ~odd}
        above = {
            f"{name}, {parity}": lines & chosen
            for name, lines in _above(numbers, high).items()
            for parity, chosen in (("odd", odd), ("even", ~odd))
        }
    else:
        classes, above = {INSIDE: inside & harmonic}, _above(numbers, high)
    classes[BETWEEN] = inside & ~harmonic
    classes |= {name: lines & harmonic & ~excited for name, lines in above.items()}
    clean = ~_humming(periods)
    return {name: lines & clean for name, lines in classes.items() if np.any(lines & clean)}


def _humming(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Lines less than one spacing away from a multiple of a mains frequency, where lines are much closer than these."""
    near = np.zeros(len(periods.frequencies), dtype=bool)
    for mains in MAINS:
        if periods.period * mains > 10:
            away = np.abs(periods.frequencies - mains * np.maximum(1, np.rint(periods.frequencies / mains)))
            near |= away < 0.999 / periods.period
    return near


def _above(numbers: NDArray[np.int64], high: int) -> dict[str, NDArray[np.bool_]]:
    return {
        SECOND: np.asarray((numbers > high) & (numbers <= 2 * high)),
        THIRD: np.asarray((numbers > 2 * high) & (numbers <= 3 * high)),
    }


@dataclass(frozen=True)
class LinearApproximation:
    """FRF of the mean periods on the excited lines, with the noise and the distortion that it carries.

    Parameters
    ----------
    frf
        FRF with a covariance: of noise and distortion where realisations tell it, else of noise alone.
    noise : (n_lines, n_responses, n_responses)
        Covariance of a realisation's mean residual ``X - G F`` by noise.
    noise_freedom
        Complex degrees of freedom behind it.
    total : (n_lines, n_responses, n_responses) or None
        The same by noise and stochastic nonlinear contributions; None: too few realisations.
    total_freedom
        Complex degrees of freedom behind it.
    excitation : (n_lines, n_excitations, n_excitations)
        ``conj(inv(F F^H))`` over the realisations, with which either becomes a covariance of G.
    level : N
        Root mean square of the forces.
    power : (n_lines, n_responses)
        Mean square of the response lines.
    """

    frf: Frf
    noise: Complex
    noise_freedom: int
    total: Complex | None
    total_freedom: int
    excitation: Complex
    level: float
    power: Real

    def distortion(self) -> Real | None:
        """Variance of the stochastic nonlinear contributions at a line, (n_lines, n_responses), below 0 by chance."""
        if self.total is None:
            return None
        return np.asarray(np.einsum("kpp->kp", self.total - self.noise).real)


def linear_approximation(periods: SteadyPeriods) -> LinearApproximation:
    """Estimate ``G = sum_m X_m F_m^H (sum_m F_m F_m^H)^-1`` from the mean spectra of M realisations.

    Noise: ``[1, -G] C [1, -G]^H / P`` with the covariance C between periods. Together with stochastic nonlinear
    contributions: ``sum_m |X_m - G F_m|^2 / (M - n_excitations)`` (the robust method for the best linear approximation:
    Pintelon & Schoukens, System Identification, 2nd ed., sections 4.3 and 7.3). A realisation that was played twice
    counts once.

    Parameters
    ----------
    periods
        Steady periods of one level.

    Raises
    ------
    InputError
        Fewer realisations than forces, or forces that are dependent at every line.
    """
    chosen = _distinct(periods)
    means = [(one.forces.mean(axis=0), one.responses.mean(axis=0)) for one in chosen.realisations]
    kept = excited_lines(chosen)
    forces, responses = (np.stack([one[part][kept] for one in means], axis=2) for part in (0, 1))
    n_lines, m, tests = forces.shape
    if tests < m:
        raise InputError(
            f"{tests} different realisations of {m} forces; give at least {m}, each with other phases, so that the "
            "forces can be told apart"
        )
    gram = forces @ forces.conj().transpose(0, 2, 1)
    valid = np.linalg.cond(gram) < 1e8
    if not valid.any():
        raise InputError(f"{m} forces are dependent at all {n_lines} excited lines; give them other phases")
    gram[~valid] = np.eye(m)
    inverse = np.linalg.inv(gram)
    values = responses @ forces.conj().transpose(0, 2, 1) @ inverse
    values[~valid] = 0.0
    joint, freedom = covariance_of_periods(periods)
    periods_inverse = float(np.mean([1 / one.n_periods for one in chosen.realisations]))
    parts = parted(joint[kept], m)
    noise = residual_covariance(*parts, values) * periods_inverse
    total, behind = None, tests - m
    if behind > 0:
        rest = responses - values @ forces
        total = rest @ rest.conj().transpose(0, 2, 1) / behind
    excitation = inverse.conj()
    quantity, unit = frf_quantity(periods.responses, periods.excitations)
    frf = Frf(
        periods.frequencies[kept],
        values,
        tuple(channel.degree_of_freedom for channel in periods.responses),
        tuple(channel.degree_of_freedom for channel in periods.excitations),
        quantity,
        unit,
        np.asarray(valid),
        None,
        FrfCovariance(noise if total is None else _no_less(total, noise), excitation),
    )
    power = np.mean(np.abs(responses) ** 2, axis=2)
    return LinearApproximation(frf, noise, freedom, total, behind, excitation, periods.level, power)


def _distinct(periods: SteadyPeriods) -> SteadyPeriods:
    """Only the first of realisations that are the same."""
    kept = [
        one
        for number, one in enumerate(periods.realisations)
        if len(periods.excitations) > 1 or not any(same_forces(one, other) for other in periods.realisations[:number])
    ]
    return SteadyPeriods(
        periods.frequencies, periods.rate, periods.period, tuple(kept), periods.excitations, periods.responses
    )


def _no_less(total: Complex, noise: Complex) -> Complex:
    """Total covariance, at lines where it came out below the noise by chance the noise."""
    more = np.einsum("kpp->k", total).real >= np.einsum("kpp->k", noise).real
    return np.asarray(np.where(more[:, None, None], total, noise))


def ratio_p_values(ratio: Real, above: Real | float, below: Real | float) -> Real:
    """Probability of a ratio of mean squares of complex Gaussian values at least as large, same shape as ``ratio``.

    Parameters
    ----------
    ratio
        Mean square over the variance that noise of its own measurement gives.
    above, below
        Complex degrees of freedom of numerator and denominator; twice as many real ones enter the F distribution.
    """
    from scipy.special import fdtrc

    return np.asarray(fdtrc(2 * np.asarray(above), 2 * np.asarray(below), np.maximum(ratio, 0.0)))


def together(p_values: Real) -> float:
    """One p-value of independent ones (n,): ``-2 sum ln p`` is chi-squared with 2 n degrees (Fisher 1925).

    Examples
    --------
    >>> round(together(np.array([0.5, 0.5])), 3), together(np.full(100, 0.01)) < 1e-50
    (0.597, True)
    """
    from scipy.special import chdtrc

    return float(chdtrc(2.0 * p_values.size, -2 * np.sum(np.log(np.maximum(p_values, 1e-300)))))


def standing_out(p_values: Real, rate: float = 0.05) -> NDArray[np.bool_]:
    """Which of p-values (n,) stand out, with a share ``rate`` of false ones among them.

    Benjamini & Hochberg, J. R. Stat. Soc. B 57, 289 (1995).

    Examples
    --------
    >>> standing_out(np.array([1e-6, 0.3, 0.04, 0.9])).tolist()
    [True, False, False, False]
    """
    order = np.argsort(p_values)
    below = np.flatnonzero(p_values[order] <= rate * np.arange(1, len(order) + 1) / len(order))
    chosen = np.zeros(len(order), dtype=bool)
    if len(below):
        chosen[order[: below[-1] + 1]] = True
    return chosen
