"""The loop gain of a time-periodic milling process at a multiplier on the unit circle."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .period_operator import PeriodOperator

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
    within, motion, impulse, free
        As in :class:`PeriodOperator`, or projected on a smaller basis.
    basis : (n_speeds, n_nodes, n) or None
        From the projection back to the nodes; None: not projected.
    """

    within: Real
    motion: Real
    impulse: Real
    free: Real
    basis: Real | None

    def matrices(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """The operator for each pair of speed index and theta, shape (n_pairs, n, n), 1/m."""
        multiplier = np.exp(1j * theta)[:, None, None]
        size = self.free.shape[-1]
        carried = np.linalg.solve(multiplier * np.eye(size) - self.free[speeds], self.impulse[speeds])
        return np.asarray((1 - 1 / multiplier) * (self.within[speeds] + self.motion[speeds] @ carried))

    def eigenvalues(self, speeds: NDArray[np.int64], theta: Real) -> Complex:
        """Eigenvalues, largest first, shape (n_pairs, n), 1/m."""
        values = np.linalg.eigvals(self.matrices(speeds, theta))
        order = np.argsort(-np.abs(values), axis=1)
        return np.asarray(np.take_along_axis(values, order, axis=1))


def loop_gain(operator: PeriodOperator, max_depth: float, *, tolerance: float = 1e-11) -> LoopGain:
    """Project a period on the few chip patterns that can build up below ``max_depth``.

    The patterns are ``(I - b G)^-1 E`` with |b| <= 2 max_depth; G is smoothing and causal, so its powers die out like
    1/k! and a Krylov basis of E, G E, G^2 E ... is complete after a few steps.

    Parameters
    ----------
    operator
        One tooth period at several speeds.
    max_depth
        m.
    tolerance
        Share of the first block below which a further one is left out.
    """
    n = operator.within.shape[1]
    blocks = [np.linalg.qr(operator.motion)[0]]
    width, left = blocks[0].shape[2], 1.0
    while left > tolerance:
        if (len(blocks) + 1) * width >= 0.8 * n:
            return LoopGain(operator.within, operator.motion, operator.impulse, operator.free, None)
        known = np.concatenate(blocks, axis=2)
        following = operator.within @ blocks[-1]
        for _ in range(2):
            following = following - known @ (known.swapaxes(1, 2) @ following)
        block, size = np.linalg.qr(following)
        left *= 2 * max_depth * float(np.linalg.norm(size, axis=(1, 2)).max())
        blocks.append(block)
    basis = np.concatenate(blocks, axis=2)
    turned = basis.swapaxes(1, 2)
    return LoopGain(
        turned @ operator.within @ basis, turned @ operator.motion, operator.impulse @ basis, operator.free, basis
    )
