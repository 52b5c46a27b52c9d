"""Residual terms for modes outside the band of a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Result, Summary


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Result):
    """Out-of-band terms: the part of the FRF in the band that modes outside it make.

    ``upper + lower / (i w)^2 + sum_k residues[k] / (i w - poles[k]) + conjugate``, on receptance. The two
    real matrices are the textbook's (Ewins, Modal Testing, 2nd ed., section 4.5); the optional terms at
    fixed poles outside the band carry the curvature that a near out-of-band mode leaves, which else
    goes into the damping of the modes inside. They stay bounded outside the band, as powers of w do not.

    Parameters
    ----------
    upper : (n_responses, n_excitations)
        Residual flexibility of the modes above the band, m/N.
    lower : (n_responses, n_excitations)
        Residual inertia of those below, m/N (rad/s)^2 (1/kg).
    poles : (n_terms,), rad/s, or None
        Fixed poles outside the band; they are no modes of the structure.
    residues : (n_terms, n_responses, n_excitations), or None
        Full-rank residue matrices at ``poles``.

    Raises
    ------
    InputError
        Only one of ``poles`` and ``residues`` is given, or their lengths differ.
    """

    upper: NDArray[np.float64]
    lower: NDArray[np.float64]
    poles: NDArray[np.complex128] | None = None
    residues: NDArray[np.complex128] | None = None

    def __post_init__(self) -> None:
        n_poles = None if self.poles is None else len(self.poles)
        n_residues = None if self.residues is None else len(self.residues)
        if n_poles != n_residues:
            raise InputError(f"residuals: {n_poles} poles but {n_residues} residue matrices; give one for each")

    def receptance(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Evaluate on the imaginary axis ``s = 2 pi i f``, shape (n_frequencies, n_responses, n_excitations).

        Raises
        ------
        InputError
            ``s`` holds 0 and there is a lower residual: it is infinite there.
        """
        if self.lower.any() and (s == 0).any():
            raise InputError("the model has a lower residual, infinite at 0 Hz; ask for frequencies above 0")
        inverse_square = np.divide(1.0, s**2, out=np.zeros_like(s), where=s != 0)
        values = self.upper + inverse_square[:, None, None] * self.lower
        if self.poles is not None and self.residues is not None:
            values = values + np.einsum("kn,npq->kpq", 1 / (s[:, None] - self.poles), self.residues)
            values = values + np.einsum("kn,npq->kpq", 1 / (s[:, None] - self.poles.conj()), self.residues.conj())
        return np.asarray(values)

    def _summary(self) -> Summary:
        terms = 0 if self.poles is None else len(self.poles)
        parts = [name for name in ("upper", "lower") if getattr(self, name).any()]
        return Summary(f"Residuals: {' and '.join(parts) or 'no'} residual, {terms} terms at poles outside the band")


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
