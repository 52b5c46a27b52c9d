"""`Frf`: a matrix of frequency response functions with its axes, quality and covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import Band, InputError, checked_band


@dataclass(frozen=True)
class FrfCovariance:
    """Covariance of an FRF matrix per line, in its natural product form.

    ``E[dH[p, q] conj(dH[u, v])] = response[k, p, u] * excitation[k, q, v]``, for H1 with response noise
    spectrum S_nn and N effective averages: ``response = S_nn``, ``excitation = conj(inv(S_ff)) / N``
    (Pintelon & Schoukens, System Identification, 2nd ed., section 7.3; Bendat & Piersol, chapter 9).

    Parameters
    ----------
    response : (n_frequencies, n_responses, n_responses)
    excitation : (n_frequencies, n_excitations, n_excitations)
    """

    response: NDArray[np.complex128]
    excitation: NDArray[np.complex128]

    def variance(self) -> NDArray[np.float64]:
        """E|dH[p, q]|^2, shape (n_frequencies, n_responses, n_excitations)."""
        rows = np.real(np.einsum("kpp->kp", self.response))
        columns = np.real(np.einsum("kqq->kq", self.excitation))
        return np.asarray(rows[:, :, None] * columns[:, None, :])


@dataclass(frozen=True)
class Frf:
    """Frequency response functions ``X = H F`` on a frequency axis.

    Parameters
    ----------
    frequencies : (n_frequencies,), Hz, increasing
    values : (n_frequencies, n_responses, n_excitations), complex, in ``unit``
    responses, excitations
        Degrees of freedom along the axes, ``node:direction``.
    quantity
        ``receptance`` (m/N), ``mobility``, ``accelerance`` (m/s^2/N) or ``transfer`` (anything else).
    unit
        Response unit over excitation unit.
    valid : (n_frequencies,), bool
        False where no FRF can be given (excitation rank below the number of inputs); every later
        step leaves those lines out. Values there are zero.
    multiple_coherence : (n_frequencies, n_responses) or None
    covariance : FrfCovariance or None
    band
        Lowest and highest frequency (Hz) between which the FRF holds; None: not known. Whoever uses it outside says so.

    Raises
    ------
    InputError
        Shapes that do not agree, or values that are not finite on valid lines.
    """

    frequencies: NDArray[np.float64]
    values: NDArray[np.complex128]
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    quantity: str
    unit: str
    valid: NDArray[np.bool_]
    multiple_coherence: NDArray[np.float64] | None = None
    covariance: FrfCovariance | None = None
    band: Band | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", checked_band(self.band, "FRF"))
        expected = (len(self.frequencies), len(self.responses), len(self.excitations))
        if self.values.shape != expected:
            raise InputError(
                f"FRF values have shape {self.values.shape}, the axes say {expected} "
                "(n_frequencies, n_responses, n_excitations); transpose or relabel"
            )
        if self.valid.shape != expected[:1]:
            raise InputError(f"FRF flag 'valid' has shape {self.valid.shape}, expected {expected[:1]}")
        if not np.isfinite(self.values[self.valid]).all():
            line = self.frequencies[self.valid][~np.isfinite(self.values[self.valid]).all(axis=(1, 2))][0]
            raise InputError(f"FRF holds NaN or infinity at {line:g} Hz; flag that line as not valid or mend the data")
