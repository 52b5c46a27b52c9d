"""The process at a new posture, given the measurements: mean and covariance of linear forms there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from .hyperparameters import Evidence, covariance_of
from .learning import LearnedPostures
from .modal_basis import PosturePlace
from .posture_kernels import SquaredDistances, squared_distances
from .process_covariance import covariance_parts
from .process_rows import Rows

Real = NDArray[np.float64]

VARYING = (1, 3)
"""Parts of the covariance that measurements in other postures tell of only as far as these are near."""


@dataclass(frozen=True)
class Conditioned:
    """The process with one set of hyperparameters, given the measurements.

    Parameters
    ----------
    hyper
        Logarithms of the hyperparameters.
    evidence
        Measured rows.
    root
        Lower Cholesky factor of their covariance.
    pulled
        That covariance's inverse times the measured values.
    """

    hyper: Real
    evidence: Evidence
    root: Real
    pulled: Real

    @property
    def length(self) -> float:
        """Length scale of the kernels."""
        return float(np.exp(self.hyper[-1]))

    def given(self, rows: Rows, across: SquaredDistances, within: SquaredDistances) -> tuple[Real, Real]:
        """Mean (n,) and covariance (n, n) of rows, given the measurements, scatter included.

        Parameters
        ----------
        across, within
            Squared distances of the rows' postures to the measured ones, and among themselves.
        """
        squares = np.exp(2 * self.hyper[:-1])
        cross = np.tensordot(squares, covariance_parts(rows, self.evidence.rows, across, self.length, False), 1)
        own = np.tensordot(squares, covariance_parts(rows, rows, within, self.length, True), 1)
        reduced = solve_triangular(self.root, cross.T, lower=True)
        return cross @ self.pulled, own - reduced.T @ reduced

    def left_unknown(self, row: Rows, across: SquaredDistances, within: SquaredDistances) -> float:
        """Share of one row's variance over postures that the measurements leave."""
        squares = np.exp(2 * self.hyper[:-1])[list(VARYING)]
        cross = covariance_parts(row, self.evidence.rows, across, self.length, False)[list(VARYING)]
        own = covariance_parts(row, row, within, self.length, True)[list(VARYING)]
        before = float(np.tensordot(squares, own, 1)[0, 0])
        reduced = solve_triangular(self.root, np.tensordot(squares, cross, 1)[0], lower=True)
        return 1 - float(reduced @ reduced) / max(before, 1e-300)


def conditioned(evidence: Evidence, hyper: Real) -> Conditioned:
    """Factor the measured rows' covariance once, for all that is asked of it."""
    factor = cho_factor(covariance_of(hyper, evidence), lower=True)
    return Conditioned(hyper, evidence, np.tril(factor[0]), cho_solve(factor, evidence.rows.value))


def distances_to(
    learned: LearnedPostures, places: list[PosturePlace]
) -> tuple[SquaredDistances, SquaredDistances]:
    """Squared distances of new postures to the measured ones, and among themselves."""
    return (
        squared_distances(learned.metric, places, list(learned.places)),
        squared_distances(learned.metric, places, places),
    )
