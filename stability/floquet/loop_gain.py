"""The loop gain of a time-periodic milling process at a multiplier on the unit circle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .collocated_period import PeriodOperator

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class LoopGain:
    """The operator whose eigenvalue is 1 / depth where a cut is on the boundary of stability.

    A motion that is multiplied by ``mu = exp(i theta)`` each tooth period has ``h = (1 - 1 / mu) y`` and
    ``z = (mu - Phi)^-1 a S h``; put into ``y = E z + a G h`` this is

    ``h / a = (1 - 1 / mu) [G + E (mu - Phi)^-1 S] h``,

    so all depths at which a multiplier is on the unit circle come out of eigenvalues over theta in (0, pi], without
    a grid of depths, exactly as in the zero-order solution but with the coefficients as they vary.

    Parameters
    ----------
    operator
        One tooth period at several speeds.
    """

    operator: PeriodOperator

    def matrices(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """The operator for each pair of speed index and theta, shape (n_pairs, n, n), 1/m."""
        multiplier = np.exp(1j * theta)[:, None, None]
        size = self.operator.free.shape[-1]
        carried = np.linalg.solve(multiplier * np.eye(size) - self.operator.free[speeds], self.operator.impulse[speeds])
        return np.asarray(
            (1 - 1 / multiplier) * (self.operator.within[speeds] + self.operator.motion[speeds] @ carried)
        )

    def eigenvalues(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """Eigenvalues, largest first, shape (n_pairs, n), 1/m."""
        values = np.linalg.eigvals(self.matrices(speeds, theta))
        order = np.argsort(-np.abs(values), axis=1)
        return np.asarray(np.take_along_axis(values, order, axis=1))
