"""Functions of s that stand for the modes outside the band, and their reading as `Residuals`."""

import numpy as np
from numpy.typing import NDArray

from .modal_model import Residuals

Complex = NDArray[np.complex128]
_ABOVE = 2.0  # the fixed pole lies at twice the band's upper end
_DAMPING = 0.05


def out_of_band_basis(s: Complex, band: tuple[float, float], *, curvature: bool) -> Complex:
    """Basis on receptance: 1, (w0/s)^2 and, with ``curvature``, a fixed pole pair above the band.

    The two textbook terms leave an error of order (w / w_mode)^2 of a near out-of-band mode, which a fit puts
    into the damping inside the band. Real and imaginary part of a residue at a fixed pole above take it up; where
    exactly that pole lies matters little, because inside the band only its value, slope and curvature show.

    Parameters
    ----------
    s : (n_lines,)
        2 pi i f.
    band
        Hz.
    curvature
        Whether to add the fixed pole.

    Returns
    -------
    (2 or 4, n_lines), dimensionless
    """
    centre = _centre(band)
    basis = [np.ones_like(s), (centre / s) ** 2]
    if curvature:
        pole = fixed_pole(band)
        plus, minus = centre / (s - pole), centre / (s - np.conj(pole))
        basis += [plus + minus, 1j * (plus - minus)]
    return np.array(basis)


def fixed_pole(band: tuple[float, float]) -> complex:
    """The pole above the band, rad/s."""
    return complex(2 * np.pi * _ABOVE * band[1] * (-_DAMPING + 1j * np.sqrt(1 - _DAMPING**2)))


def residuals_from(outside: NDArray[np.float64], band: tuple[float, float]) -> Residuals:
    """Read the fitted coefficients (n_terms, n_responses, n_excitations) as residual terms."""
    centre = _centre(band)
    upper, lower = outside[0], outside[1] * centre**2
    if len(outside) == 2:
        return Residuals(upper, lower)
    residue = centre * (outside[2] + 1j * outside[3])
    return Residuals(upper, lower, np.array([fixed_pole(band)]), residue[None])


def _centre(band: tuple[float, float]) -> float:
    return float(2 * np.pi * np.sqrt(band[0] * band[1]))
