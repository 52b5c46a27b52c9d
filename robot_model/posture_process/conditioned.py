"""The process at a new posture, given the measurements: mean and covariance of linear forms there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from .hyperparameters import Evidence, covariance_of
from .learning import LearnedPostures
from .modes import PosturePlace
from .posture_kernels import SquaredDistances, joint_kernels, squared_distances
from .process_covariance import covariance_parts
from .process_rows import Rows

Real = NDArray[np.float64]

EXACT = 0.02
"""Variance of a measurement, as a share, that counts as exact: how far a posture is must not depend on noise."""


@dataclass(frozen=True)
class Conditioned:
    """The process with one set of hyperparameters, given the measurements.

    Parameters
    ----------
    hyper
        Logarithms of the hyperparameters.
    evidence
        Measured rows and the distances of their postures.
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


def conditioned(evidence: Evidence, hyper: Real) -> Conditioned:
    """Factor the measured rows' covariance once, for all that is asked of it."""
    factor = cho_factor(covariance_of(hyper, evidence), lower=True)
    return Conditioned(hyper, evidence, np.tril(factor[0]), cho_solve(factor, evidence.rows.value))


def distances_to(learned: LearnedPostures, places: list[PosturePlace]) -> tuple[SquaredDistances, SquaredDistances]:
    """Squared distances of new postures to the measured ones, and among themselves."""
    return (
        squared_distances(learned.metric, places, list(learned.places)),
        squared_distances(learned.metric, places, places),
    )


def left_unknown(learned: LearnedPostures, energy: Real, across: SquaredDistances) -> float:
    """Share of the variance over postures that exact measurements would leave in one new posture.

    ``1 - k^T (K + 0.02 I)^-1 k`` of each elastic part's kernel, weighed by the parts' shares of energy.

    Parameters
    ----------
    learned
        Process over postures.
    energy : (n_stiffnesses,)
        Shares of the elastic parts in the energy of the modes that matter.
    across
        Squared distances of the posture to the measured ones.
    """
    length = float(np.exp(learned.best[-1]))
    own = joint_kernels(learned.evidence.distances, length)
    left = [
        1 - float(near[0] @ np.linalg.solve(among + EXACT * np.eye(len(among)), near[0]))
        for near, among in zip(joint_kernels(across, length), own, strict=True)
    ]
    return float(np.asarray(energy) @ np.array(left) / np.sum(energy))
