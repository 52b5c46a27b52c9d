"""`Residuals`: the terms of a modal model that stand for modes outside its band."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError, Result, Summary


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
