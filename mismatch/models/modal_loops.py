"""Loops over lines of a modal model and of its derivatives. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@compiled
def modal_displacement(s: Complex, poles: Complex, right: Complex, left: Complex, force: Complex, out: Complex) -> None:
    """Write ``sum_r right_r (left_r . F) / (s - p_r)`` and its conjugate half.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    poles : (n_modes,), rad/s
        Poles of the modes, one of each conjugate pair.
    right : (n_modes, n_responses)
        Right vectors of the modes; ``right left^T`` is the residue, m/(N s).
    left : (n_modes, n_excitations)
        Left vectors of the modes.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    out : (n, n_responses), m
        Receives the displacement at the lines.
    """
    for k in range(len(s)):
        out[k] = 0.0
        for r in range(len(poles)):
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push /= s[k] - poles[r]
            pull /= s[k] - poles[r].conjugate()
            for p in range(right.shape[1]):
                out[k, p] += right[r, p] * push + right[r, p].conjugate() * pull


@compiled
def modal_slopes(
    s: Complex,
    force: Complex,
    modes: tuple[Complex, Complex, Complex],
    units: tuple[Complex, Complex, Real, Real],
    factor: Complex,
    out: Complex,
) -> None:
    """Write the derivative of ``factor * (H F)`` by every number of every mode, as `ModelShape` orders them.

    Parameters
    ----------
    s : (n,), rad/s
        Laplace variable ``i omega`` of the lines.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    modes
        Poles (n_modes,), right (n_modes, n_responses) and left vectors (n_modes, n_excitations).
    units
        Change of each pole by a unit of frequency and of damping, units of right and of left entries, each (n_modes,).
    factor : (n, n_responses)
        Factor that the displacement at each line is multiplied by.
    out : (n, n_responses, n_columns)
        Receives the derivatives in the modes' columns; the columns behind them are left alone.
    """
    poles, right, left = modes
    by_frequency, by_damping, right_unit, left_unit = units
    n, m = right.shape[1], left.shape[1]
    size = 2 + 2 * n + 2 * m
    for k in range(len(s)):
        for r in range(len(poles)):
            first = r * size
            up, down = 1.0 / (s[k] - poles[r]), 1.0 / (s[k] - poles[r].conjugate())
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(m):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push *= up
            pull *= down
            for p in range(n):
                one, other = factor[k, p] * right[r, p], factor[k, p] * right[r, p].conjugate()
                row = out[k, p]
                row[first] = one * up * push * by_frequency[r] + other * down * pull * by_frequency[r].conjugate()
                row[first + 1] = one * up * push * by_damping[r] + other * down * pull * by_damping[r].conjugate()
                row[first + 2 : first + 2 + 2 * n] = 0.0
                row[first + 2 + p] = factor[k, p] * right_unit[r] * (push + pull)
                row[first + 2 + n + p] = 1j * factor[k, p] * right_unit[r] * (push - pull)
                for q in range(m):
                    a, b = one * up * force[k, q], other * down * force[k, q]
                    row[first + 2 + 2 * n + q] = left_unit[r] * (a + b)
                    row[first + 2 + 2 * n + m + q] = 1j * left_unit[r] * (a - b)
