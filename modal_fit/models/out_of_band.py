"""Residual terms for modes outside the band of a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.core import Band, Complex, InputError, Real, Result, Summary

from ..settings import SETTINGS


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Result):
    """Contribution of modes outside the band to the FRF inside the band.

    On receptance it is ``upper + lower / (i w)^2 + sum_k residues[k] / (i w - poles[k]) + conjugate``. The matrices
    ``upper`` and ``lower`` are the residual terms of the textbooks (Ewins, Modal Testing, 2nd ed., section 4.5). The
    optional terms at fixed poles outside the band take up the curvature of a near out-of-band mode, which would
    otherwise bias the damping of the modes inside. Unlike higher powers of w, they stay bounded outside the band.

    Parameters
    ----------
    upper : (n_responses, n_excitations)
        Residual flexibility of the modes above the band, m/N.
    lower : (n_responses, n_excitations)
        Residual inertia of the modes below the band, m/N (rad/s)^2 (1/kg).
    poles : (n_terms,), rad/s, or None
        Fixed poles outside the band; they are no modes of the structure.
    residues : (n_terms, n_responses, n_excitations), or None
        Full-rank residue matrices at ``poles``.

    Raises
    ------
    InputError
        Only one of ``poles`` and ``residues`` is given, or their lengths differ.
    """

    upper: Real
    lower: Real
    poles: Complex | None = None
    residues: Complex | None = None

    def __post_init__(self) -> None:
        n_poles = None if self.poles is None else len(self.poles)
        n_residues = None if self.residues is None else len(self.residues)
        if n_poles != n_residues:
            raise InputError(f"residuals: {n_poles} poles but {n_residues} residue matrices; give one for each")

    def receptance(self, s: Complex) -> Complex:
        """Evaluate the terms at ``s = 2 pi i f``, shape (n_frequencies, n_responses, n_excitations).

        Raises
        ------
        InputError
            ``s`` holds 0 and there is a lower residual: it is infinite there.
        """
        if self.lower.any() and (s == 0).any():
            raise InputError("the model has a lower residual, infinite at 0 Hz; evaluate it at frequencies above 0")
        inverse_square = np.divide(1.0, s**2, out=np.zeros_like(s), where=s != 0)
        values = self.upper + inverse_square[:, None, None] * self.lower
        if self.poles is not None and self.residues is not None:
            values = values + np.einsum("kn,npq->kpq", 1 / (s[:, None] - self.poles), self.residues)
            values = values + np.einsum("kn,npq->kpq", 1 / (s[:, None] - self.poles.conj()), self.residues.conj())
        return np.asarray(values)

    def _summary(self) -> Summary:
        n_terms = 0 if self.poles is None else len(self.poles)
        names = [name for name in ("upper", "lower") if getattr(self, name).any()]
        return Summary(f"Residuals: {' and '.join(names) or 'no'} residual, {n_terms} terms at poles outside the band")


def fixed_poles(band: Band, below: Sequence[float] = (0.7,), above: Sequence[float] = (1.3, 3.0)) -> list[complex]:
    """Return poles (rad/s) at multiples ``below`` of the band's lower edge and ``above`` of its upper edge.

    For a mode that lies a third above the band, a pole near the upper edge together with a pole far above leaves a
    fiftieth of the error that a single pole at twice the upper edge leaves.
    """
    zeta = SETTINGS.fixed_pole_damping
    places = [(factor, band[0]) for factor in below] + [(factor, band[1]) for factor in above]
    return [complex(2 * np.pi * factor * edge * (-zeta + 1j * np.sqrt(1 - zeta**2))) for factor, edge in places]


def out_of_band_basis(s: Complex, band: Band, poles: Sequence[complex]) -> Complex:
    """Return the out-of-band functions on receptance at ``s`` (rad/s), dimensionless, (2 + 2 n_poles, n_lines).

    They are 1, (w0/s)^2, and two functions of each fixed pole, for the real and imaginary part of its residue. The
    first two alone leave an error of order (w / w_mode)^2 of a near out-of-band mode. The place of the fixed poles
    matters little, because only their value, slope and curvature show inside the band.
    """
    centre = _centre(band)
    basis = [np.ones_like(s), (centre / s) ** 2]
    for pole in poles:
        plus, minus = centre / (s - pole), centre / (s - np.conj(pole))
        basis += [plus + minus, 1j * (plus - minus)]
    return np.array(basis)


def residuals_from(coefficients: Real, band: Band, poles: Sequence[complex]) -> Residuals:
    """Convert coefficients (2 + 2 n_poles, n_responses, n_excitations) of :func:`out_of_band_basis` to residuals."""
    centre = _centre(band)
    upper, lower = coefficients[0], coefficients[1] * centre**2
    if not poles:
        return Residuals(upper, lower)
    residues = np.asarray(centre * (coefficients[2::2] + 1j * coefficients[3::2]), dtype=np.complex128)
    return Residuals(upper, lower, np.array(poles, dtype=np.complex128), residues)


def _centre(band: Band) -> float:
    """Return the geometric mean of the band edges, rad/s, which scales the terms to size 1 in the band."""
    return float(2 * np.pi * np.sqrt(band[0] * band[1]))
