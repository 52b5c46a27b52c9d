"""Points of a stability boundary: where an eigenvalue over a multiplier's phase is real and positive."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Matrices = Callable[[Complex], Complex]
"""From multipliers (n,) to matrices (n, m, m) whose eigenvalues are reciprocal cutting stiffnesses."""


def lowest_crossing(matrices: Matrices, phases: Real, highest: float) -> tuple[float, float, str] | None:
    """Lowest cutting stiffness ``a K_tc`` up to ``highest`` (N/m) on the boundary: stiffness, phase (rad), type.

    Parameters
    ----------
    matrices
        Of which reciprocal eigenvalues are stiffnesses at a multiplier on the unit circle.
    phases : (n,), rad, rising, between 0 and pi
        Where to look; a crossing between two of them is refined.
    highest
        N/m.
    """
    found = [crossing for crossing in _crossings(matrices, phases, highest) if crossing[0] <= highest]
    return min(found, default=None)


def _crossings(matrices: Matrices, phases: Real, highest: float) -> list[tuple[float, float, str]]:
    """Stiffness, phase and type wherever an eigenvalue is real and positive."""
    smallest = 0.2 / highest  # eigenvalues below this belong to depths far beyond the largest asked for
    values = np.linalg.eigvals(matrices(np.exp(1j * phases)))
    found: list[tuple[float, float, str]] = []
    for k in range(len(phases) - 1):
        here, after = values[k], values[k + 1]
        for value in here[np.abs(here) > smallest]:
            partner = after[np.argmin(np.abs(after - value))]
            if value.imag * partner.imag <= 0 and max(value.real, partner.real) > 0:
                root = _refined(matrices, phases[k], phases[k + 1], complex(value), complex(partner))
                if root is not None and root[0] > 0:
                    found.append((1 / root[0], root[1], "hopf"))
    doubled = np.linalg.eigvals(matrices(np.array([-1.0 + 0j])))[0]
    real = doubled[(np.abs(doubled.imag) < 1e-9 * np.abs(doubled).max()) & (doubled.real > smallest)].real
    return found + [(1 / value, math.pi, "period-doubling") for value in real]


def _refined(
    matrices: Matrices, low: float, high: float, value: complex, partner: complex
) -> tuple[float, float] | None:
    """Phase between two where the eigenvalue's imaginary part vanishes, by the Illinois rule; value there."""
    a, b, fa, fb = low, high, value.imag, partner.imag
    near, side = value, 0
    for _ in range(60):
        if fb == fa:
            break
        middle = b - fb * (b - a) / (fb - fa)
        values = np.linalg.eigvals(matrices(np.array([np.exp(1j * middle)])))[0]
        share = (middle - low) / (high - low)
        guess = value + share * (partner - value) if abs(partner - value) < 0.5 * abs(value) else near
        near = complex(values[np.argmin(np.abs(values - guess))])
        if abs(near.imag) < 1e-11 * abs(near) or abs(b - a) < 1e-14:
            return near.real, middle
        if near.imag * fb > 0:
            b, fb = middle, near.imag
            fa, side = (fa / 2 if side == -1 else fa), -1
        else:
            a, fa = middle, near.imag
            fb, side = (fb / 2 if side == 1 else fb), 1
    return (near.real, b) if abs(near.imag) < 1e-6 * abs(near) else None
