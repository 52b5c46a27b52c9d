"""Normal approximation of a sample, about which new draws are proposed."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import Real

from .production_cuts import Prediction


@dataclass(frozen=True)
class Centre:
    """Normal approximation of a sample: narrower than the prior in some directions, the prior in all others.

    Only directions in which the predictions of the cuts change can be narrower; a linear regression over the draws
    finds these d. If nothing is learned, the covariance of n draws has eigenvalues from ``(1 - sqrt(d / n))^2`` on
    there (Marchenko & Pastur, Math. USSR Sb. 1, 1967); the directions with less are kept.

    Parameters
    ----------
    directions : (dimension, n)
        Orthonormal directions in which the sample is narrower than the prior.
    mean : (n,)
        Mean along these directions; along all others it is 0, that of the prior.
    covariance : (n, n)
        Covariance along these directions; along all others it is that of the prior, 1.
    """

    directions: Real
    mean: Real
    covariance: Real

    @classmethod
    def of(cls, numbers: Real, weights: Real, prediction: Prediction) -> "Centre":
        """Return the approximation of a weighted sample (n_draws, dimension)."""
        changing = _changing(numbers, np.concatenate([prediction.growth, prediction.place], axis=1))
        inside = numbers @ changing
        mean = weights @ inside
        covariance = (inside - mean).T * weights @ (inside - mean)
        values, vectors = np.linalg.eigh(covariance)
        share = inside.shape[1] * float(np.sum(weights**2))
        narrow = vectors[:, values < max(1 - np.sqrt(share), 0.0) ** 2]
        return cls(changing @ narrow, mean @ narrow, narrow.T @ covariance @ narrow)

    @property
    def whole_mean(self) -> Real:
        """Return the mean of all numbers, (dimension,)."""
        return np.asarray(self.directions @ self.mean)

    @property
    def whole_covariance(self) -> Real:
        """Return the covariance of all numbers, (dimension, dimension)."""
        less = np.eye(len(self.mean)) - self.covariance
        return np.asarray(np.eye(len(self.directions)) - self.directions @ less @ self.directions.T)

    def density(self, numbers: Real) -> Real:
        """Return the logarithm of the density over that of the prior, up to a constant, of each draw of numbers."""
        along = numbers @ self.directions
        about = np.linalg.solve(np.linalg.cholesky(self.covariance), (along - self.mean).T)
        return np.asarray(0.5 * np.sum(along**2, axis=1) - 0.5 * np.sum(about**2, axis=0))

    def near(self, numbers: Real, step: float, generator: np.random.Generator) -> Real:
        """Propose numbers near others; with acceptance by the approximation alone every proposal would be accepted.

        ``z' = m + sqrt(1 - step^2) (z - m) + step x`` with x from the approximation without its mean m (Cotter,
        Roberts, Stuart & White, Statistical Science 28, 2013).
        """
        normal = generator.standard_normal(numbers.shape)
        along = normal @ self.directions
        fresh = normal + (along @ np.linalg.cholesky(self.covariance).T - along) @ self.directions.T
        return np.asarray(self.whole_mean + np.sqrt(1 - step**2) * (numbers - self.whole_mean) + step * fresh)


def _changing(numbers: Real, predictions: Real) -> Real:
    """Return orthonormal directions (dimension, n) in which the predictions (n_draws, n_predictions) change."""
    centred = predictions - predictions.mean(axis=0)
    slopes = np.linalg.lstsq(numbers - numbers.mean(axis=0), centred, rcond=None)[0]
    slopes = slopes[:, np.abs(slopes).max(axis=0) > 0]
    return np.asarray(np.linalg.qr(slopes / np.linalg.norm(slopes, axis=0))[0])
