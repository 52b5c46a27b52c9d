"""FRF estimators from averaged spectra: H1, H2, Hv and instrumental variables."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real

from .frf.frf_matrix import Frf, FrfCovariance
from .frf.quantities import frf_quantity
from .spectra.coherence_functions import RANK_TOLERANCE, independent_lines, input_independence, multiple_coherence
from .spectra.cross_spectra import CrossSpectra, check_stackable, lines_of, spectral_width, sum_tests


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
    return _frf_of_least_squares(spectra, values, valid, _covariance(spectra, values, inverse, valid))


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
    return _frf_of_least_squares(total, values, valid, reference.covariance)


def _frf_of_least_squares(
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


def h2(spectra: CrossSpectra) -> Frf:
    """``H = S_xx S_fx^+``: unbiased by noise on the excitations, biased up by noise on the responses.

    For several inputs the right inverse ``S_fx^H (S_fx S_fx^H)^-1`` is taken, so that there must be at least as many
    responses as excitations (Ewins, Modal Testing, 2nd ed., section 3.9).

    Raises
    ------
    InputError
        Fewer responses than excitations, or inputs dependent on every line.
    """
    n_responses, n_excitations = len(spectra.responses), len(spectra.excitations)
    if n_responses < n_excitations:
        raise InputError(
            f"H2 needs as many responses as excitations; {n_responses} responses for {n_excitations} excitations. "
            "Use H1 or Hv"
        )
    valid = _independent_lines(spectra)
    s_fx = spectra.cross_spectra.conj().transpose(0, 2, 1)
    values = np.zeros_like(spectra.cross_spectra)
    adjoint = s_fx.conj().transpose(0, 2, 1)
    regular = valid & (np.linalg.matrix_rank(_balanced(s_fx), tol=None) == n_excitations)
    values[regular] = (spectra.output_spectra @ adjoint)[regular] @ np.linalg.inv((s_fx @ adjoint)[regular])
    return _frf_of_error_in_variables(spectra, values, regular, spectra.input_spectra)


def hv(spectra: CrossSpectra, response_noise: Real | None = None, excitation_noise: Real | None = None) -> Frf:
    """Total least squares: for each response, the eigenvector of the smallest eigenvalue of its scaled spectral matrix.

    With noise spectra known up to a common factor, the matrix of ``(x_p, f)`` is scaled by their roots; the
    eigenvector v of its smallest eigenvalue gives ``H_pq = -conj(v_q / v_0)`` in the scaled quantities (Rocklin,
    Crowley & Vold, IMAC 1985). H1 and H2 are its limits without excitation or response noise.

    Parameters
    ----------
    spectra
        Spectra of one test, or of several summed by :func:`sum_tests`.
    response_noise : (n_responses,), or None
        Relative noise power of each response; None: its mean power, that is, noise in equal shares.
    excitation_noise : (n_excitations,), or None
        Relative noise power of each excitation; None: its mean power.

    Raises
    ------
    InputError
        Noise powers that are not positive, or inputs dependent on every line.
    """
    valid = _independent_lines(spectra)
    responses = _powers(spectra.output_spectra, response_noise, "response")
    excitations = _powers(spectra.input_spectra, excitation_noise, "excitation")
    n = len(excitations)
    values = np.zeros_like(spectra.cross_spectra)
    for p in range(len(responses)):
        scale = np.sqrt(np.concatenate([responses[p : p + 1], excitations]))
        matrix = np.empty((len(values), n + 1, n + 1), dtype=complex)
        matrix[:, 0, 0] = spectra.output_spectra[:, p, p]
        matrix[:, 0, 1:] = spectra.cross_spectra[:, p]
        matrix[:, 1:, 0] = spectra.cross_spectra[:, p].conj()
        matrix[:, 1:, 1:] = spectra.input_spectra
        vector = np.linalg.eigh(matrix / np.outer(scale, scale))[1][:, :, 0]
        safe = np.where(np.abs(vector[:, :1]) > 0, vector[:, :1], 1.0)
        values[:, p] = -(vector[:, 1:] / safe).conj() * scale[0] / scale[1:]
    values[~valid] = 0.0
    return _frf_of_error_in_variables(spectra, values, valid, spectra.input_spectra)


def instrumental_variable(spectra: CrossSpectra, instruments: Sequence[str]) -> Frf:
    """``H = S_xr S_rr^-1 S_rf (S_fr S_rr^-1 S_rf)^-1``: unbiased where force noise and response are correlated.

    In the cut, regeneration feeds the response back into the force; what moves the structure without being
    measured (a disturbance) then sits in both, and H1 tends towards the inverse of the feedback. An instrument r is
    something that drives the force but that the disturbance does not reach: the spindle's angle, a commanded signal
    (Pintelon & Schoukens, System Identification, 2nd ed., section 2.6; Wellstead 1981).

    Parameters
    ----------
    spectra
        Made with the instruments among the excitation channels.
    instruments
        Names of those channels; the other excitations are the forces.

    Raises
    ------
    InputError
        A name that is not there, fewer instruments than forces, or instruments that do not drive the forces.
    """
    names = [channel.name for channel in spectra.excitations]
    missing = [name for name in instruments if name not in names]
    if missing:
        raise InputError(f"no excitation channel {missing[0]!r} to serve as instrument; there are {', '.join(names)}")
    r = [names.index(name) for name in instruments]
    f = [number for number in range(len(names)) if number not in r]
    if not f or len(r) < len(f):
        raise InputError(f"{len(r)} instruments for {len(f)} forces; give at least as many instruments as forces")
    s_rr, s_fr = spectra.input_spectra[:, r][:, :, r], spectra.input_spectra[:, f][:, :, r]
    s_ff = spectra.input_spectra[:, f][:, :, f]
    inverse = np.linalg.pinv(s_rr, rcond=1e-10, hermitian=True)
    projected = s_fr @ inverse @ s_fr.conj().transpose(0, 2, 1)
    reached = np.linalg.svd(_relative(projected, s_ff), compute_uv=False, hermitian=True)[:, -1]
    valid = (reached > RANK_TOLERANCE) & (spectra.n_segments >= len(r))
    if not valid.any():
        raise InputError("the instruments do not drive the forces on any line; choose others or average more")
    s_xr = spectra.cross_spectra[:, :, r]
    values = np.zeros((len(valid), len(spectra.responses), len(f)), dtype=complex)
    numerator = s_xr @ inverse @ s_fr.conj().transpose(0, 2, 1)
    values[valid] = numerator[valid] @ np.linalg.inv(projected[valid])
    return _frf_of_error_in_variables(_without(spectra, f), values, valid, projected)


def _without(spectra: CrossSpectra, kept: Sequence[int]) -> CrossSpectra:
    """The spectra with some of the excitations only."""
    return replace(
        spectra,
        input_spectra=spectra.input_spectra[:, kept][:, :, kept],
        cross_spectra=spectra.cross_spectra[:, :, kept],
        excitations=tuple(spectra.excitations[number] for number in kept),
    )


def _independent_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    valid = input_independence(spectra).independent
    if not valid.any():
        n = len(spectra.excitations)
        raise InputError(
            f"the {n} inputs are dependent on every line: give at least {n} tests with different immersions, "
            "or shorter segments"
        )
    return valid


def _powers(spectra: Complex, given: Real | None, role: str) -> Real:
    power = np.real(np.einsum("kii->ki", spectra)).mean(axis=0) if given is None else np.asarray(given, dtype=float)
    if power.shape != (spectra.shape[1],) or not (np.isfinite(power).all() and (power > 0).all()):
        raise InputError(f"{role} noise powers {power.tolist()} must be {spectra.shape[1]} positive numbers")
    return power


def _balanced(matrix: Complex) -> Complex:
    """Rows scaled to unit length, so that rank does not depend on units."""
    length = np.linalg.norm(matrix, axis=2, keepdims=True)
    return np.asarray(matrix / np.where(length > 0, length, 1.0))


def _relative(matrix: Complex, to: Complex) -> Complex:
    """Scaled by the roots of the diagonal of ``to``."""
    root = np.sqrt(np.real(np.einsum("kii->ki", to)))
    safe = np.where(root > 0, root, 1.0)
    return np.asarray(matrix / safe[:, :, None] / safe[:, None, :])


def _frf_of_error_in_variables(
    spectra: CrossSpectra, values: Complex, valid: NDArray[np.bool_], driving: Complex
) -> Frf:
    """Give the FRF with the covariance of the equation error ``X - H F``, over the inputs ``driving``."""
    quantity, unit = frf_quantity(spectra.responses, spectra.excitations)
    averages, n = spectra.effective_averages, len(spectra.excitations)
    covariance = None
    if averages > n + 0.5:
        mixed = values @ spectra.cross_spectra.conj().transpose(0, 2, 1)
        error = spectra.output_spectra - mixed - mixed.conj().transpose(0, 2, 1)
        error = error + values @ spectra.input_spectra @ values.conj().transpose(0, 2, 1)
        error = (error + error.conj().transpose(0, 2, 1)) / 2 * averages / (averages - n)
        inverse = np.zeros_like(driving)
        inverse[valid] = np.linalg.inv(driving[valid])
        error[~valid] = 0.0
        covariance = FrfCovariance(error, inverse.conj() / averages)
    return Frf(
        spectra.frequencies,
        values,
        tuple(channel.degree_of_freedom for channel in spectra.responses),
        tuple(channel.degree_of_freedom for channel in spectra.excitations),
        quantity,
        unit,
        valid,
        multiple_coherence(spectra),
        covariance,
        spectral_width=spectral_width(spectra.settings, spectra.sample_rate),
    )
