"""Best linear approximation from periodic forces: FRF, its noise, and what realisations differ by beyond noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..frf_matrix import Frf, FrfCovariance, frf_quantity
from .cut_periods import SteadyPeriods, same_forces
from .line_classes import excited_lines
from .noise_between_periods import covariance_of_periods
from .noise_type import parted, residual_covariance

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
