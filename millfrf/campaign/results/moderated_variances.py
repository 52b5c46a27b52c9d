"""Variances of many short series, each drawn towards what all have in common, with that itself uncertain."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from millfrf.core import Real

FREEDOM = np.logspace(0.2, 3, 18)
"""Degrees of freedom that the common variance may be worth: few where series differ, many where they are alike."""

USUAL_FREEDOM, DECADES = 6.0, 0.4
"""Prior of them: median, and standard deviation in powers of ten. A handful of series cannot tell them."""

FACTORS = np.exp(np.linspace(-3.5, 3.5, 57))
"""Common variance factors about the mean of all series; every one as likely before (in its logarithm)."""


@dataclass(frozen=True)
class Moderated:
    """Variance factor of one series: a mixture of scaled inverse chi-squares.

    Parameters
    ----------
    weights : (n,)
        Probabilities of the parts, one together.
    factors : (n,)
        Variance factor of each part.
    freedoms : (n,)
        Degrees of freedom of each part.
    """

    weights: Real
    factors: Real
    freedoms: Real

    @property
    def factor(self) -> float:
        """Mean variance factor."""
        return float(self.weights @ self.factors)

    @property
    def freedom(self) -> float:
        """Degrees of freedom that the mixture is worth: the harmonic mean of its parts."""
        return float(1 / (self.weights @ (1 / self.freedoms)))

    def p_value(self, ratio: float) -> float:
        """Two-sided probability of a value as many standard errors (of factor one) from zero.

        Parameters
        ----------
        ratio
            Value over its standard error where the variance factor is one.
        """
        parts = 2 * scipy.stats.t.sf(abs(ratio) / np.sqrt(self.factors), self.freedoms)
        return min(1.0, float(self.weights @ parts))


@dataclass(frozen=True)
class CommonVariance:
    """Misfits of series in groups: each group has a common variance, each series its own about it.

    ``misfit / freedom ~ factor F(freedom, common freedom)`` (Smyth, Stat. Appl. Genet. Mol. Biol. 3, 2004), with a
    factor for each group, and common degrees of freedom for all of them. Instead of their most likely values, all of a
    grid count by their probability.

    Parameters
    ----------
    misfits : (n_series,)
        Sums of squared residuals over their variances.
    freedom : (n_series,)
        Their degrees of freedom; series without any say nothing.
    groups
        Number of the group of each series.
    """

    misfits: Real
    freedom: Real
    groups: Sequence[int]

    @cached_property
    def _centres(self) -> dict[int, float]:
        """Mean ratio of misfit to freedom in each group."""
        found = {}
        for group in set(self.groups):
            chosen = [k for k, g in enumerate(self.groups) if g == group and self.freedom[k] > 0]
            total = float(np.sum(self.freedom[chosen]))
            found[group] = max(float(np.sum(self.misfits[chosen])) / total, 1e-6) if total else 1.0
        return found

    @cached_property
    def _single(self) -> Real:
        """Log-likelihood of each series, (n_series, n_factors, n_freedoms)."""
        return np.array([self._likelihood(*one) for one in zip(self.misfits, self.freedom, self.groups, strict=True)])

    @cached_property
    def _sums(self) -> dict[int, Real]:
        """Log-likelihood of each group."""
        found = {group: np.zeros((len(FACTORS), len(FREEDOM))) for group in set(self.groups)}
        for group, one in zip(self.groups, self._single, strict=True):
            found[group] = found[group] + one
        return found

    @cached_property
    def _elsewhere(self) -> dict[int, Real]:
        """Logarithm of the prior of the common degrees of freedom, and of what the other groups say of them."""
        prior = -0.5 * (np.log10(FREEDOM / USUAL_FREEDOM) / DECADES) ** 2
        said = {group: np.asarray(scipy.special.logsumexp(one, axis=0)) for group, one in self._sums.items()}
        total = np.sum(list(said.values()), axis=0)
        return {group: prior + total - one for group, one in said.items()}

    def moderated(self, number: int, misfit: float, freedom: float) -> Moderated:
        """Variance factor of one series from all others, and from a misfit of its own.

        Parameters
        ----------
        number
            Number of the series; what it said as one of all is taken out.
        misfit
            Sum of squared residuals over their variances that counts for it instead.
        freedom
            Degrees of freedom of that misfit; 0: it says nothing.
        """
        group = self.groups[number]
        own = self._sums[group] - self._single[number] + self._likelihood(misfit, freedom, group)
        weights = own + self._elsewhere[group]
        weights = np.exp(weights - weights.max())
        factors = (FREEDOM * FACTORS[:, None] * self._centres[group] + misfit) / (FREEDOM + freedom)
        kept = (weights > 1e-9).ravel()
        freedoms = np.broadcast_to(FREEDOM + freedom, factors.shape).ravel()[kept]
        return Moderated(weights.ravel()[kept] / weights.ravel()[kept].sum(), factors.ravel()[kept], freedoms)

    def _likelihood(self, misfit: float, freedom: float, group: int) -> Real:
        """Logarithm of the density of F over the grid; zero without degrees of freedom."""
        if not freedom > 0:
            return np.zeros((len(FACTORS), len(FREEDOM)))
        ratio = max(misfit / freedom, 1e-6 * self._centres[group]) / (FACTORS[:, None] * self._centres[group])
        return np.asarray(
            0.5 * freedom * np.log(freedom * ratio / FREEDOM)
            - 0.5 * (freedom + FREEDOM) * np.log1p(freedom * ratio / FREEDOM)
            - scipy.special.betaln(freedom / 2, FREEDOM / 2)
        )
