"""Moderated variances of many short series, with an uncertain common variance (empirical Bayes)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from millfrf.core import Real

# grid of prior degrees of freedom: few if the variances of series differ, many if they are equal
FREEDOM = np.logspace(0.2, 3, 18)

# their prior: median, and standard deviation in decades. A few series do not determine them.
USUAL_FREEDOM, DECADES = 6.0, 0.4

# grid of common variance factors relative to the mean of all series; flat prior of the logarithm
FACTORS = np.exp(np.linspace(-3.5, 3.5, 57))


@dataclass(frozen=True)
class Moderated:
    """Variance factor of one series: a mixture of scaled inverse chi-squares."""

    weights: Real  # (n,); probabilities of the components
    factors: Real  # (n,); variance factors of the components
    freedoms: Real  # (n,); degrees of freedom of the components

    @property
    def factor(self) -> float:
        """Mean variance factor."""
        return float(self.weights @ self.factors)

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom: harmonic mean over the components."""
        return float(1 / (self.weights @ (1 / self.freedoms)))

    def p_value(self, ratio: float) -> float:
        """Return the two-sided p-value of a value; ``ratio`` is value over standard error for the variance factor 1."""
        parts = 2 * scipy.stats.t.sf(abs(ratio) / np.sqrt(self.factors), self.freedoms)
        return min(1.0, float(self.weights @ parts))


@dataclass(frozen=True)
class CommonVariance:
    """Hierarchical model of the variances of series in groups.

    The ratio of misfit to degrees of freedom is distributed as ``factor F(freedom, prior freedom)`` (Smyth, Stat. Appl.
    Genet. Mol. Biol. 3, 2004), with a factor for each group and common prior degrees of freedom. Factors and prior
    degrees of freedom are integrated over a grid, because few series do not determine them.
    """

    misfits: Real  # (n_series,); chi-squares
    freedom: Real  # (n_series,); degrees of freedom; 0: no information
    groups: Sequence[int]  # (n_series,); number of the group

    @cached_property
    def _centres(self) -> dict[int, float]:
        """Mean ratio of misfit to freedom in each group."""
        centres = {}
        for group in set(self.groups):
            chosen = [k for k, g in enumerate(self.groups) if g == group and self.freedom[k] > 0]
            total = float(np.sum(self.freedom[chosen]))
            centres[group] = max(float(np.sum(self.misfits[chosen])) / total, 1e-6) if total else 1.0
        return centres

    @cached_property
    def _single(self) -> Real:
        """Log-likelihood over series (first axis), factors and prior degrees of freedom of the grid."""
        return np.array([self._likelihood(*row) for row in zip(self.misfits, self.freedom, self.groups, strict=True)])

    @cached_property
    def _sums(self) -> dict[int, Real]:
        """Log-likelihood of each group."""
        sums = {group: np.zeros((len(FACTORS), len(FREEDOM))) for group in set(self.groups)}
        for group, likelihood in zip(self.groups, self._single, strict=True):
            sums[group] = sums[group] + likelihood
        return sums

    @cached_property
    def _other_groups(self) -> dict[int, Real]:
        """Log prior of the degrees of freedom plus the log evidence of the other groups."""
        prior = -0.5 * (np.log10(FREEDOM / USUAL_FREEDOM) / DECADES) ** 2
        evidence = {
            group: np.asarray(scipy.special.logsumexp(likelihood, axis=0)) for group, likelihood in self._sums.items()
        }
        total = np.sum(list(evidence.values()), axis=0)
        return {group: prior + total - likelihood for group, likelihood in evidence.items()}

    def moderated(self, number: int, misfit: float, freedom: float) -> Moderated:
        """Return the posterior variance factor of one series, from its misfit and from all other series."""
        group = self.groups[number]
        log_posterior = self._sums[group] - self._single[number] + self._likelihood(misfit, freedom, group)
        weights = log_posterior + self._other_groups[group]
        weights = np.exp(weights - weights.max())
        factors = (FREEDOM * FACTORS[:, None] * self._centres[group] + misfit) / (FREEDOM + freedom)
        relevant = (weights > 1e-9).ravel()
        freedoms = np.broadcast_to(FREEDOM + freedom, factors.shape).ravel()[relevant]
        return Moderated(
            weights.ravel()[relevant] / weights.ravel()[relevant].sum(), factors.ravel()[relevant], freedoms
        )

    def _likelihood(self, misfit: float, freedom: float, group: int) -> Real:
        """Return the log density of the F distribution over the grid; zero for a series without degrees of freedom."""
        if not freedom > 0:
            return np.zeros((len(FACTORS), len(FREEDOM)))
        ratio = max(misfit / freedom, 1e-6 * self._centres[group]) / (FACTORS[:, None] * self._centres[group])
        return np.asarray(
            0.5 * freedom * np.log(freedom * ratio / FREEDOM)
            - 0.5 * (freedom + FREEDOM) * np.log1p(freedom * ratio / FREEDOM)
            - scipy.special.betaln(freedom / 2, FREEDOM / 2)
        )
