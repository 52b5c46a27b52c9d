"""`Structure`: the true modes of a simulated set, and the FRFs that they make, from the textbook's sum."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Structure:
    """Modes of a linear structure.

    ``H[p, q] = sum_r A_r[p, q] / (s - pole_r) + conj(A_r[p, q]) / (s - conj(pole_r)) + rigid[p, q] / s^2`` with
    ``A_r[p, q] = right[r, p] left[r, q] / (2 i Im pole_r)`` (Ewins, Modal Testing, 2nd ed., sections 2.6-2.7).

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles in the upper half plane.
    right : (n_modes, n_responses), left : (n_modes, n_excitations)
        Mass-normalised vectors, 1/sqrt(kg).
    rigid : (n_responses, n_excitations)
        Inverse mass matrix of the free body, 1/kg; zeros where it is held.
    """

    poles: Complex
    right: Complex
    left: Complex
    rigid: Real

    @property
    def frequencies(self) -> Real:
        """Natural frequencies, Hz."""
        return np.asarray(np.abs(self.poles) / (2 * np.pi))

    @property
    def dampings(self) -> Real:
        """Damping ratios."""
        return np.asarray(-self.poles.real / np.abs(self.poles))

    @property
    def bandwidths(self) -> Real:
        """Half-power bandwidths ``2 zeta f``, Hz."""
        return 2 * self.dampings * self.frequencies

    def residues(self, mode: int) -> Complex:
        """``A_r``, (n_responses, n_excitations)."""
        return np.asarray(np.outer(self.right[mode], self.left[mode]) / (2j * self.poles[mode].imag))

    def frf(self, frequencies: Real, derivative: int) -> Complex:
        """FRFs at ``frequencies`` (Hz, above 0) of motion differentiated ``derivative`` times."""
        s = 2j * np.pi * frequencies
        values = self.rigid / (s**2)[:, None, None]
        for mode, pole in enumerate(self.poles):
            residue = self.residues(mode)
            values = values + residue / (s - pole)[:, None, None] + residue.conj() / (s - pole.conj())[:, None, None]
        return np.asarray(values * (s**derivative)[:, None, None])


def poles_of(frequencies: Real, dampings: Real) -> Complex:
    """``w (-zeta + i sqrt(1 - zeta^2))``, rad/s."""
    omega = 2 * np.pi * frequencies
    return np.asarray(omega * (-dampings + 1j * np.sqrt(1 - dampings**2)))


def assurance(first: Complex, second: Complex) -> float:
    """Modal assurance criterion of two vectors (Allemang & Brown 1982)."""
    return float(abs(np.vdot(first, second)) ** 2 / (np.vdot(first, first).real * np.vdot(second, second).real))
