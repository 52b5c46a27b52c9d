"""How a structure in the cut differs from the same structure at rest, measured on modes that both tests show."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex, Real

from .agreement import SensorAgreement


@dataclass(frozen=True)
class Change:
    """Logarithm of a quantity in the cut over that at rest.

    Parameters
    ----------
    mean
        Mean over the matched modes.
    scatter
        Standard deviation of a single mode about the mean, beyond the errors of the measurement.
    error
        Standard error that all other modes share: that of the mean, and half the mean itself, because no cut has shown
        whether those modes change at all; two standard errors reach to no change.
    """

    mean: float
    scatter: float
    error: float


def change_of(logarithms: Real, variances: Real) -> Change:
    """Estimate mean and scatter of a change from single modes, weighted by their errors (DerSimonian & Laird 1986).

    With one mode its scatter is not known; it is taken to be as large as the change.

    Parameters
    ----------
    logarithms, variances : (n_modes,)
        Change of each mode, and its variance by measurement; 0 where that is not known.

    Examples
    --------
    >>> change = change_of(np.array([0.04, 0.06]), np.zeros(2))
    >>> round(change.mean, 4), round(change.scatter, 4), round(change.error, 4)
    (0.05, 0.0141, 0.0269)
    """
    variances = np.where(np.isfinite(variances), variances, 0.0)
    n = len(logarithms)
    if n == 1:
        mean = float(logarithms[0])
        return Change(mean, abs(mean), float(np.hypot(np.sqrt(variances[0]), mean / 2)))
    floor = 1e-12 + 1e-6 * float(np.mean(variances))
    weights = 1 / (variances + floor)
    mean = float(weights @ logarithms / weights.sum())
    excess = float(weights @ (logarithms - mean) ** 2) - (n - 1)
    between = max(excess / float(weights.sum() - weights @ weights / weights.sum()), 0.0)
    weights = 1 / (variances + between + floor)
    mean = float(weights @ logarithms / weights.sum())
    return Change(mean, float(np.sqrt(between)), float(np.hypot(1 / np.sqrt(weights.sum()), mean / 2)))


@dataclass(frozen=True)
class RestAndCut:
    """Changes from rest to cut of natural frequencies, damping ratios and mass-normalised residues."""

    frequency: Change
    damping: Change
    residue: Change

    def poles(self, poles: Complex) -> Complex:
        """Return poles at rest (rad/s) as they are expected in the cut."""
        natural = np.abs(poles) * np.exp(self.frequency.mean)
        zeta = np.minimum(-poles.real / np.abs(poles) * np.exp(self.damping.mean), 0.99)
        return np.asarray(natural * (-zeta + 1j * np.sqrt(1 - zeta**2)))

    def residue_factors(self, poles: Complex) -> Real:
        """Return the factors of residues ``phi phi / (2 i w_d)`` of modes with these poles at rest."""
        return np.asarray(np.exp(self.residue.mean) * poles.imag / self.poles(poles).imag)


def rest_and_cut(agreement: SensorAgreement) -> RestAndCut:
    """Estimate the changes from modes that were measured in the cut and by hammer at the sensor."""

    def of_pairs(values: Real, errors: Real) -> Change:
        return change_of(np.log(values[:, 0] / values[:, 1]), np.sum((errors / values) ** 2, axis=1))

    size = np.abs(agreement.factors)
    return RestAndCut(
        of_pairs(agreement.frequencies, agreement.frequency_errors),
        of_pairs(agreement.damping, agreement.damping_errors),
        change_of(np.log(size), (agreement.factor_errors / size) ** 2),
    )
