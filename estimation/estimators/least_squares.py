"""H1: the least-squares FRF with noise on the responses, for any number of inputs and stacked tests."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..frf_matrix import Frf, FrfCovariance, frf_quantity
from ..spectra import (
    CrossSpectra,
    check_stackable,
    independent_lines,
    lines_of,
    multiple_coherence,
    spectral_width,
    sum_tests,
)


def h1(spectra: CrossSpectra) -> Frf:
    """``H = S_xf S_ff^-1`` (Mohammadi & Ahmadi, Eq. 7), with multiple coherence and covariance.

    The covariance is ``S_nn / (n - n_inputs) * n`` for the response noise and ``conj(S_ff^-1) / n`` for the
    excitation, n effective averages (Bendat & Piersol, Random Data, 4th ed., section 9.2).

    Parameters
    ----------
    spectra
        Spectra of one test, or of several summed by :func:`sum_tests`.

    Returns
    -------
    Frf
        Lines where the inputs are not independent are zero and not ``valid``.

    Raises
    ------
    InputError
        No line has independent inputs: fewer tests or segments than inputs, or dependent ones.
    """
    valid = independent_lines(spectra)
    if not valid.any():
        n_inputs = len(spectra.excitations)
        raise InputError(
            f"the {n_inputs} inputs are dependent on every line ({spectra.n_tests} tests, {spectra.n_segments} "
            f"segments): give at least {n_inputs} tests with different immersions, or shorter segments"
        )
    inverse = np.zeros_like(spectra.input_spectra)
    inverse[valid] = np.linalg.inv(spectra.input_spectra[valid])
    values = spectra.cross_spectra @ inverse
    return _frf(spectra, values, valid, _covariance(spectra, values, inverse, valid))


def h1_side_by_side(tests: Sequence[CrossSpectra]) -> Frf:
    """``H = S_xf S_ff^+`` with the tests' spectra set side by side (Eq. 12), n_excitations x n_tests n_excitations.

    Other than in the sum, a test weighs by the square of its power; where noise is equal the sum is the better
    estimate, and its covariance is given here too.

    Raises
    ------
    InputError
        Tests that cannot be stacked, or dependent inputs on every line.
    """
    check_stackable(tests)
    total = sum_tests(tests)
    reference = h1(total)
    s_ff = np.concatenate([test.input_spectra for test in tests], axis=2)
    s_xf = np.concatenate([test.cross_spectra for test in tests], axis=2)
    values = np.zeros_like(total.cross_spectra)
    adjoint = s_ff.conj().transpose(0, 2, 1)
    valid = reference.valid
    values[valid] = (s_xf @ adjoint)[valid] @ np.linalg.inv((s_ff @ adjoint)[valid])
    return _frf(total, values, valid, reference.covariance)


def _frf(
    spectra: CrossSpectra, values: NDArray[np.complex128], valid: NDArray[np.bool_], covariance: FrfCovariance | None
) -> Frf:
    """Give the FRF with its multiple coherence: from H itself where there is one, else by pseudo-inverse."""
    total = np.real(np.einsum("kpp->kp", spectra.output_spectra))
    explained = np.real(np.einsum("kpq,kpq->kp", values, spectra.cross_spectra.conj()))
    coherence = np.clip(np.divide(explained, total, out=np.zeros(total.shape), where=total > 0), 0.0, 1.0)
    coherence[~valid] = multiple_coherence(lines_of(spectra, ~valid))
    quantity, unit = frf_quantity(spectra.responses, spectra.excitations)
    return Frf(
        spectra.frequencies,
        values,
        tuple(channel.degree_of_freedom for channel in spectra.responses),
        tuple(channel.degree_of_freedom for channel in spectra.excitations),
        quantity,
        unit,
        valid,
        coherence,
        covariance,
        spectral_width=spectral_width(spectra.settings, spectra.sample_rate),
    )


def _covariance(
    spectra: CrossSpectra,
    values: NDArray[np.complex128],
    inverse: NDArray[np.complex128],
    valid: NDArray[np.bool_],
) -> FrfCovariance | None:
    """Estimate the covariance from the residual response power; None where there are too few averages."""
    averages, n_inputs = spectra.effective_averages, len(spectra.excitations)
    if averages <= n_inputs + 0.5:
        return None
    noise = spectra.output_spectra - values @ spectra.cross_spectra.conj().transpose(0, 2, 1)
    noise = (noise + noise.conj().transpose(0, 2, 1)) / 2 * averages / (averages - n_inputs)
    noise[~valid] = 0.0
    return FrfCovariance(noise, inverse.conj() / averages)
