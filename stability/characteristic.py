"""The characteristic function of a milling process: an entire function of depth times (1 - 1 / multiplier)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .period_operator import PeriodOperator

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Characteristic:
    """``F(theta, a) = det[mu - M(b)] mu^(-n/2)`` with ``mu = exp(i theta)`` and ``b = a (1 - 1 / mu)``.

    A motion multiplied by mu each tooth period sees the delayed force as ``a (1 - 1 / mu) D(t) y``, an ordinary
    periodic equation; M(b) is its transition over a period, n x n with n = 2 n_modes. So all the delay is in b, and
    F is known everywhere from a few power series in b.

    Parameters
    ----------
    coefficients : (n_speeds, n + 1, n_powers)
        Real series of the characteristic polynomial's coefficients in b / radius; first mu^n, last mu^0.
    radius
        Largest |b| that they are meant for, 2 max_depth, m.
    accuracy : (n_speeds,)
        Rounding error of F: the series' terms cancel when the radius is large.
    """

    coefficients: Real
    radius: float
    accuracy: Real

    @property
    def usable(self) -> bool:
        """Whether the series are complete and precise enough to find roots on; they are refined elsewhere."""
        return bool((self.accuracy < 1e-6).all())

    def needed_powers(self, *, tolerance: float = 1e-8) -> NDArray[np.int64]:
        """Powers that matter in each sixteenth of the radius, (n_speeds, 16): enough to find roots, not to refine."""
        share = np.arange(1, 17) / 16
        count = self.coefficients.shape[2]
        size = np.abs(self.coefficients).max(axis=1)[:, None, :] * share[:, None] ** np.arange(count)
        matters = size > tolerance
        return np.where(matters.any(axis=2), count - np.argmax(matters[:, :, ::-1], axis=2), 1).astype(np.int64)


def characteristic(operator: PeriodOperator, max_depth: float, *, most_powers: int = 120) -> Characteristic:
    """Series of the characteristic polynomial for depths up to ``max_depth`` (m).

    ``M(b) = Phi + sum_k b^(k+1) S G^k E``. G is causal and smoothing, so that the powers die out like 1/k!.
    """
    radius = 2 * max_depth
    n_speeds, size = operator.free.shape[:2]
    terms = [operator.free]
    vector = operator.motion
    largest = np.abs(terms[0]).max(axis=(1, 2))
    rounding = np.zeros(n_speeds)
    reach = np.abs(operator.impulse).sum(axis=2).max(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(most_powers):
            vector = radius * vector
            rounding = np.maximum(rounding, reach * np.abs(vector).max(axis=(1, 2)))
            term = operator.impulse @ vector
            terms.append(term)
            here = np.abs(term).max(axis=(1, 2))
            largest = np.maximum(largest, here)
            if not np.isfinite(here).all() or (len(terms) > 3 and (here < 1e-17 * largest).all()):
                break
            vector = operator.within @ vector
    whole = bool(np.isfinite(largest).all() and (here < 1e-15 * largest).all())
    if not whole:
        return Characteristic(np.zeros((n_speeds, size + 1, 1)), radius, np.full(n_speeds, np.inf))
    # values on the circle |b| = radius, so that products of series are products of numbers
    points = len(terms) + (size * len(terms)) // 2
    on_circle = np.fft.fft(np.stack(terms, axis=1), n=points, axis=1)
    polynomial = _characteristic_polynomial(on_circle)
    series = np.real(np.fft.ifft(polynomial, axis=1)).swapaxes(1, 2)
    accuracy = 2e-16 * np.maximum(np.abs(polynomial).max(axis=(1, 2)), rounding)
    used = np.flatnonzero((np.abs(series) > accuracy[:, None, None]).any(axis=(0, 1)))
    return Characteristic(np.ascontiguousarray(series[:, :, : int(used[-1]) + 1]), radius, accuracy)


def _characteristic_polynomial(matrices: Complex) -> Complex:
    """Coefficients (..., n + 1) of det(mu - M), highest power first, by Faddeev and LeVerrier."""
    size = matrices.shape[-1]
    identity = np.eye(size)
    coefficients = [np.ones(matrices.shape[:-2], dtype=complex)]
    partial = np.broadcast_to(identity, matrices.shape).astype(complex)
    for k in range(1, size + 1):
        product = matrices @ partial
        coefficient = -np.trace(product, axis1=-2, axis2=-1) / k
        coefficients.append(coefficient)
        partial = product + coefficient[..., None, None] * identity
    return np.stack(coefficients, axis=-1)
