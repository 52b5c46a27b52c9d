"""Crossings refined on a discretised tooth period itself, by Newton's method on its transition matrix."""

import numpy as np
from numpy.typing import NDArray

from ..floquet.collocated_period import PeriodOperator
from .crossings import Crossings

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def transition(operator: PeriodOperator, speeds: NDArray[np.int64], b: Complex) -> tuple[Complex, Complex]:
    """M(b) over a period and dM/db at pairs of speed index and b (m), each shape (n_pairs, n, n).

    ``M = Phi + b S (I - b G)^-1 E`` and ``dM/db = S (I - b G)^-2 E``.
    """
    n_nodes = operator.within.shape[-1]
    factor = b[:, None, None]
    inverse = np.linalg.inv(np.eye(n_nodes) - factor * operator.within[speeds])
    after = inverse @ operator.motion[speeds]
    before = operator.impulse[speeds] @ inverse
    return operator.free[speeds] + factor * (operator.impulse[speeds] @ after), before @ after


def polished(operator: PeriodOperator, found: Crossings, *, steps: int = 3) -> tuple[Crossings, NDArray[np.bool_]]:
    """Move crossings to where they lie for this operator.

    The eigenvalue of M(a (1 - 1/mu)) nearest mu is made equal to ``mu = exp(i theta)`` by Newton steps in (theta, a);
    at theta = pi everything is real and only the depth moves.

    Returns
    -------
    crossings
    settled : (n,), bool
        False where the steps did not settle near the beginning.
    """
    theta, depth = found.theta.copy(), found.depth.copy()
    at_pi = found.theta == np.pi
    last = np.zeros(len(depth))
    for _ in range(steps if len(depth) else 0):
        multiplier = np.exp(1j * theta)
        factor = 1 - 1 / multiplier
        matrix, slope = transition(operator, found.speed, depth * factor)
        values, vectors = np.linalg.eig(matrix)
        chosen = np.argmin(np.abs(values - multiplier[:, None]), axis=1)
        rows = np.arange(len(chosen))
        left = np.linalg.inv(vectors)[rows, chosen]
        by_b = np.einsum("ci,cij,cj->c", left, slope, vectors[rows, :, chosen])
        gap = values[rows, chosen] - multiplier
        by_depth = by_b * factor
        by_theta = 1j * (by_b * depth / multiplier - multiplier)
        determinant = by_theta.real * by_depth.imag - by_theta.imag * by_depth.real
        safe = np.where(determinant == 0, 1.0, determinant)
        theta_step = (gap.real * by_depth.imag - gap.imag * by_depth.real) / safe
        depth_step = (by_theta.real * gap.imag - by_theta.imag * gap.real) / safe
        theta = np.where(at_pi, np.pi, theta - theta_step)
        last = np.where(at_pi, (gap / np.where(by_depth == 0, 1.0, by_depth)).real, depth_step)
        depth = depth - last
    near = (np.abs(theta - found.theta) < 0.1) & (np.abs(depth - found.depth) < 0.1 * found.depth)
    return Crossings(found.speed, depth, theta, found.outward), near & (np.abs(last) < 1e-6 * found.depth)
