"""Functions of s that stand for the modes outside the band, and their reading as `Residuals`."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .residuals import Residuals

Complex = NDArray[np.complex128]
ABOVE: tuple[tuple[float, ...], ...] = ((), (2.0,), (1.3, 3.0))
"""Fixed poles above the band, as multiples of its upper end: none, one, or one near it and one far above."""

_DAMPING = 0.05


def out_of_band_basis(s: Complex, band: tuple[float, float], above: Sequence[float] = ABOVE[1]) -> Complex:
    """Give the basis on receptance: 1, (w0/s)^2 and two functions of each fixed pole above the band.

    The two textbook terms leave an error of order (w / w_mode)^2 of a near out-of-band mode, which a fit puts
    into the damping inside the band. Real and imaginary part of a residue at a fixed pole above take it up; where
    exactly that pole lies matters little, because inside the band only its value, slope and curvature show.

    Parameters
    ----------
    s : (n_lines,), rad/s
        Laplace variable 2 pi i f of each line.
    band : Hz
        Lowest and highest frequency of the fit.
    above
        Places of the fixed poles, as multiples of the band's upper end.

    Returns
    -------
    (2 + 2 n_poles, n_lines), dimensionless
    """
    return basis_with_poles(s, band, [fixed_pole(band, place) for place in above])


def basis_with_poles(s: Complex, band: tuple[float, float], poles: Sequence[complex]) -> Complex:
    """Basis on receptance: 1, (w0/s)^2, and two functions of each fixed pole, (2 + 2 n_poles, n_lines)."""
    centre = _centre(band)
    basis = [np.ones_like(s), (centre / s) ** 2]
    for pole in poles:
        plus, minus = centre / (s - pole), centre / (s - np.conj(pole))
        basis += [plus + minus, 1j * (plus - minus)]
    return np.array(basis)


def fixed_poles(
    band: tuple[float, float], below: Sequence[float] = (0.7,), above: Sequence[float] = (1.3, 3.0)
) -> list[complex]:
    """Poles (rad/s) at multiples of the band's lower and upper end.

    One near the upper end and one far above leave a fiftieth of the error of one at twice the upper end, where a mode
    stands a third above the band.
    """
    return [fixed_pole((band[0], band[0]), place) for place in below] + [fixed_pole(band, place) for place in above]


def fixed_pole(band: tuple[float, float], above: float = 2.0) -> complex:
    """The pole above the band, rad/s."""
    return complex(2 * np.pi * above * band[1] * (-_DAMPING + 1j * np.sqrt(1 - _DAMPING**2)))


def residuals_from(outside: NDArray[np.float64], band: tuple[float, float]) -> Residuals:
    """Read the coefficients (2 + 2 n_poles, n_responses, n_excitations) of :func:`out_of_band_basis`."""
    return residuals_with_poles(outside, band, [fixed_pole(band, place) for place in ABOVE[len(outside) // 2 - 1]])


def residuals_with_poles(
    outside: NDArray[np.float64], band: tuple[float, float], poles: Sequence[complex]
) -> Residuals:
    """Read the coefficients (2 + 2 n_poles, n_responses, n_excitations) of :func:`basis_with_poles`."""
    centre = _centre(band)
    upper, lower = outside[0], outside[1] * centre**2
    if not poles:
        return Residuals(upper, lower)
    residues = np.asarray(centre * (outside[2::2] + 1j * outside[3::2]), dtype=np.complex128)
    return Residuals(upper, lower, np.array(poles, dtype=np.complex128), residues)


def _centre(band: tuple[float, float]) -> float:
    return float(2 * np.pi * np.sqrt(band[0] * band[1]))
