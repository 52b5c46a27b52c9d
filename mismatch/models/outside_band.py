"""What modes outside a model's band leave inside it: terms that a fit may change, as it may change the modes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel, Residuals

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

TERMS = 3
"""Flexibility of the modes above, its curvature, inertia of the modes below."""

FAR, DAMPING = 2.0, 0.05
"""Frequency of the mode whose curvature is taken, over the band's upper end, and its damping; both matter little."""

POINTS = 128
"""Number of points in the band at which the size of the terms is set."""


@dataclass(frozen=True)
class OutsideBand:
    """Terms on receptance, ``sum_k c_k[p, q] b_k(s)``, each c_k one unit where it is as large as a shape error.

    Parameters
    ----------
    units : (TERMS, n_responses, n_excitations), m/N
        Size of each term in the band that counts as one unit.
    scale : (TERMS,)
        Root mean square of each basis over the band.
    pole
        Pole of the mode that gives the curvature, rad/s.
    lowest
        Angular frequency below which the inertia of lower modes says nothing and is left out, rad/s.
    """

    units: Real
    scale: Real
    pole: complex
    lowest: float

    @property
    def size(self) -> int:
        """Number of all coefficients of the terms."""
        return int(self.units.size)

    def basis(self, s: Complex) -> Complex:
        """The three functions at ``s`` (n,), rad/s, each about one in the band, (TERMS, n)."""
        return _basis(s, self.pole, self.lowest) / self.scale[:, None]

    def added(self, residuals: Residuals | None, numbers: Real) -> Residuals:
        """A model's residual terms with these numbers (size,) on top."""
        upper, bend, lower = numbers.reshape(self.units.shape) * self.units / self.scale[:, None, None]
        if residuals is not None:
            upper, lower = residuals.upper + upper, residuals.lower + lower
        poles, residues = np.array([self.pole]), (bend * _residue(self.pole))[None]
        if residuals is not None and residuals.poles is not None and residuals.residues is not None:
            poles = np.append(residuals.poles, poles)
            residues = np.concatenate([residuals.residues, residues])
        return Residuals(upper, lower, poles, residues)


def outside_band(model: ModalModel, share: float) -> OutsideBand | None:
    """Terms for a model that states its band; None for one that does not, which is compared with all its reach.

    Parameters
    ----------
    model
        The model as the lab believes it.
    share
        Share of the receptance's root mean square over the band that counts as one unit: the lab's error of shapes.
    """
    if model.band is None:
        return None
    frequencies = np.linspace(max(model.band[0], 0.02 * model.band[1]), model.band[1], POINTS)
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    size = np.sqrt(np.mean(np.abs(model.receptance(frequencies)) ** 2, axis=0))
    omega = 2 * np.pi * FAR * model.band[1]
    pole = complex(omega * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2)))
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    scale = np.sqrt(np.mean(np.abs(_basis(s, pole, lowest)) ** 2, axis=1))
    return OutsideBand(np.tile(share * size, (TERMS, 1, 1)), scale, pole, lowest)


def _residue(pole: complex) -> complex:
    """Residue of the mode ``|pole|^2 / (s^2 + 2 zeta |pole| s + |pole|^2)``."""
    return abs(pole) ** 2 / (2j * pole.imag)


def _basis(s: Complex, pole: complex, lowest: float) -> Complex:
    residue = _residue(pole)
    mode = residue / (s - pole) + np.conj(residue) / (s - np.conj(pole))
    lower = np.divide(1.0, s**2, out=np.zeros_like(s), where=np.abs(s) >= lowest)
    return np.array([np.ones_like(s), mode, lower])
