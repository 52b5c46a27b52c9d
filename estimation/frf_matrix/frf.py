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
    coherence : (n_frequencies, n_responses, n_excitations) or None
        Ordinary coherence of each entry, 0 to 1; NaN in entries where it is not known (a single tap).
    averages : (n_responses, n_excitations), int, or None
        Number of averages behind each entry; 0 where it is not known.
    exponential_time_constant
        tau (s) of the window ``exp(-t / tau)`` that force and response were multiplied by; None: no such window. The
        values then stand on the line ``s = i w + 1/tau`` beside the imaginary axis (:attr:`laplace`), where every pole
        seems ``1/tau`` further away: an FRF that is read as it stands shows too much damping. A fit takes it back.

    Raises
    ------
    InputError
        Shapes that do not agree, values that are not finite on valid lines, a coherence outside 0 to 1, or a time
        constant that is not positive.
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
    coherence: NDArray[np.float64] | None = None
    averages: NDArray[np.int64] | None = None
    exponential_time_constant: float | None = None

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
        _check_coherence(self.coherence, self.averages, self.valid, expected)
        tau = self.exponential_time_constant
        if tau is not None and not (np.isfinite(tau) and tau > 0):
            raise InputError(
                f"time constant {tau!r} s of the exponential window must be positive; leave it out if none"
            )

    @property
    def laplace(self) -> NDArray[np.complex128]:
        """Where in the Laplace plane the values stand: ``i w``, with an exponential window ``i w + 1/tau``, rad/s.

        Returns
        -------
        (n_frequencies,), complex
        """
        damping = 0.0 if self.exponential_time_constant is None else 1 / self.exponential_time_constant
        return np.asarray(2j * np.pi * self.frequencies + damping)

    def entry_variance(self) -> NDArray[np.float64] | None:
        """Variance ``E|dH[p, q]|^2`` of each entry, from the covariance where there is one, else from the coherence.

        ``|H|^2 (1 - g^2) / (g^2 (n - 1))`` with coherence ``g^2`` over n averages and one input at a time, noise on the
        response (Bendat & Piersol, Random Data, 4th ed., section 9.2; their n is n - 1 here, because a coherence that
        was estimated from the same n averages leaves out one of them).

        Returns
        -------
        (n_frequencies, n_responses, n_excitations) or None
            Infinite where the coherence is 0, and NaN in entries whose coherence is not known or that have fewer than
            two averages. None where this holds for all of them.

        Examples
        --------
        >>> axis, entry = np.array([1.0, 2.0]), ("A:+X",)
        >>> coherence = np.array([0.9, 0.5]).reshape(2, 1, 1)
        >>> frf = Frf(axis, np.full((2, 1, 1), 3 + 0j), entry, entry, "mobility", "m/s/N", axis > 0,
        ...           coherence=coherence, averages=np.array([[11]]))
        >>> frf.entry_variance()[:, 0, 0]
        array([0.1, 0.9])
        """
        if self.covariance is not None:
            return self.covariance.variance()
        if self.coherence is None or self.averages is None or not (self.averages > 1).any():
            return None
        spare = np.where(self.averages > 1, self.averages - 1.0, np.nan)
        coherence = np.where(np.isfinite(spare), self.coherence, np.nan)
        with np.errstate(divide="ignore"):
            unknown = np.divide(1 - coherence, coherence)
        variance = np.abs(self.values) ** 2 * unknown / spare
        return None if np.isnan(variance[self.valid]).all() else np.asarray(variance)


def _check_coherence(
    coherence: NDArray[np.float64] | None,
    averages: NDArray[np.int64] | None,
    valid: NDArray[np.bool_],
    expected: tuple[int, ...],
) -> None:
    if coherence is not None:
        if coherence.shape != expected:
            raise InputError(f"the coherence has shape {coherence.shape}, the FRF {expected}; give one for each entry")
        known = coherence[valid]
        wrong = known[(known < -1e-6) | (known > 1 + 1e-6)]
        if len(wrong):
            raise InputError(f"a coherence of {wrong[0]:g} lies outside 0 to 1; estimate anew or leave it out")
    if averages is not None:
        if averages.shape != expected[1:]:
            raise InputError(f"the averages have shape {averages.shape}, the entries {expected[1:]}; give one for each")
        if (averages < 0).any():
            raise InputError(f"{averages.min()} averages; give the number of averages of each entry, 0 if not known")
