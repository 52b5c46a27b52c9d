"""FRF estimators: H1, H2, Hv, instrumental variables, and local polynomials in frequency for short recordings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real

from .band_recordings.band_recording import BandRecording
from .frf.frf_matrix import Frf, FrfCovariance
from .frf.quantities import frf_of_channels
from .settings import FRFS, RECORDINGS
from .spectra.coherence_functions import (
    explained_share,
    independent_lines,
    multiple_coherence,
    powers,
    scaled_by,
)
from .spectra.cross_spectra import (
    CrossSpectra,
    check_stackable,
    line_step,
    lines_of,
    only_inputs,
    spectral_width,
    sum_tests,
)


def h1(spectra: CrossSpectra) -> Frf:
    """Estimate ``H = S_xf S_ff^-1`` (Mohammadi & Ahmadi, Eq. 7), with multiple coherence and covariance.

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
    valid = _independent_lines(spectra)
    inverse = _inverse(spectra.input_spectra, valid)
    values = spectra.cross_spectra @ inverse
    noise = np.empty(spectra.output_spectra.shape, dtype=complex)
    step = line_step(noise)
    for start in range(0, len(noise), step):  # in steps, because the matrices of all lines are in no cache
        here = slice(start, start + step)
        np.matmul(values[here], _adjoint(spectra.cross_spectra[here]), out=noise[here])
        np.subtract(spectra.output_spectra[here], noise[here], out=noise[here])
    coherence = explained_share(powers(spectra.output_spectra) - powers(noise), spectra)
    coherence[~valid] = multiple_coherence(lines_of(spectra, ~valid))  # by the slower pseudo-inverse
    return _frf(spectra, values, valid, noise, inverse, coherence)


def h1_side_by_side(tests: Sequence[CrossSpectra]) -> Frf:
    """Estimate ``H = S_xf S_ff^+`` with the spectra of all tests side by side (Mohammadi & Ahmadi, Eq. 12).

    S_ff is n_excitations x (n_tests n_excitations). Each test is weighted by the square of its power. Where all tests
    have the same noise, :func:`h1` of the summed spectra is more accurate; its covariance is stated here as well.

    Parameters
    ----------
    tests
        Spectra of each test, of the same channels and settings.

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
    # S_ff^+ is the right inverse, S_ff^H (S_ff S_ff^H)^-1
    values = np.zeros_like(total.cross_spectra)
    valid = reference.valid
    values[valid] = (s_xf @ _adjoint(s_ff))[valid] @ np.linalg.inv((s_ff @ _adjoint(s_ff))[valid])
    return replace(reference, values=values, multiple_coherence=_coherence(total, values, valid))


def h2(spectra: CrossSpectra) -> Frf:
    """Estimate ``H = S_xx S_fx^+``: noise on the excitations gives no bias, noise on the responses too large an FRF.

    For several inputs the right inverse ``S_fx^H (S_fx S_fx^H)^-1`` is taken, so that there must be at least as many
    responses as excitations (Ewins, Modal Testing, 2nd ed., section 3.9).

    Parameters
    ----------
    spectra
        Spectra of one test, or of several summed by :func:`sum_tests`.

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
    s_fx = _adjoint(spectra.cross_spectra)
    length = np.linalg.norm(s_fx, axis=2, keepdims=True)
    # rows of unit length, so that the rank does not depend on units
    balanced = s_fx / np.where(length > 0, length, 1.0)
    regular = valid & (np.linalg.matrix_rank(balanced, tol=None) == n_excitations)
    values = np.zeros_like(spectra.cross_spectra)
    adjoint = _adjoint(s_fx)
    values[regular] = (spectra.output_spectra @ adjoint)[regular] @ np.linalg.inv((s_fx @ adjoint)[regular])
    return _frf_of_equation_error(spectra, values, regular, spectra.input_spectra)


def hv(spectra: CrossSpectra, response_noise: Real | None = None, excitation_noise: Real | None = None) -> Frf:
    """Estimate the FRF of each response by total least squares, with noise on response and excitations.

    With noise spectra known up to a common factor, the spectral matrix of ``(x_p, f)`` is scaled by their roots; the
    eigenvector v of its smallest eigenvalue gives ``H_pq = -conj(v_q / v_0)`` in the scaled quantities (Rocklin,
    Crowley & Vold, IMAC 1985). H1 and H2 are its limits without excitation or response noise.

    Parameters
    ----------
    spectra
        Spectra of one test, or of several summed by :func:`sum_tests`.
    response_noise : (n_responses,), or None
        Relative noise power of each response; None: its mean power, so that noise is the same share of every channel.
    excitation_noise : (n_excitations,), or None
        Relative noise power of each excitation; None: its mean power.

    Raises
    ------
    InputError
        Noise powers that are not positive, or inputs dependent on every line.
    """
    valid = _independent_lines(spectra)
    responses = _noise_powers(spectra.output_spectra, response_noise, "response")
    excitations = _noise_powers(spectra.input_spectra, excitation_noise, "excitation")
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
        # dependent forces may give an eigenvector without the response
        safe = np.where(np.abs(vector[:, :1]) > 0, vector[:, :1], 1.0)
        values[:, p] = -(vector[:, 1:] / safe).conj() * scale[0] / scale[1:]
    values[~valid] = 0.0
    return _frf_of_equation_error(spectra, values, valid, spectra.input_spectra)


def instrumental_variable(spectra: CrossSpectra, instruments: Sequence[str]) -> Frf:
    """Estimate ``H = S_xr S_rr^-1 S_rf (S_fr S_rr^-1 S_rf)^-1``: unbiased where force noise and response correlate.

    In the cut, regeneration feeds the response back into the force. A disturbance that moves the structure without
    being measured is then in both, and H1 tends towards the inverse of the feedback. An instrument r is a signal that
    drives the force and that the disturbance does not reach: the spindle's angle, or a commanded signal (Pintelon &
    Schoukens, System Identification, 2nd ed., section 2.6; Wellstead 1981).

    Parameters
    ----------
    spectra
        Spectra with the instruments among the excitation channels.
    instruments
        Names of the instrument channels; the other excitations are the forces.

    Raises
    ------
    InputError
        A missing channel, fewer instruments than forces, or instruments that do not drive the forces.
    """
    names = [channel.name for channel in spectra.excitations]
    missing = [name for name in instruments if name not in names]
    if missing:
        raise InputError(f"no excitation channel {missing[0]!r} to serve as instrument; there are {', '.join(names)}")
    r = [names.index(name) for name in instruments]
    f = [number for number in range(len(names)) if number not in r]
    if not f or len(r) < len(f):
        raise InputError(f"{len(r)} instruments for {len(f)} forces; give at least as many instruments as forces")
    forces = only_inputs(spectra, [names[number] for number in f])
    s_rr, s_fr = spectra.input_spectra[:, r][:, :, r], spectra.input_spectra[:, f][:, :, r]
    inverse = np.linalg.pinv(s_rr, rcond=1e-10, hermitian=True)
    projected = s_fr @ inverse @ _adjoint(s_fr)
    # share of each force that the instruments explain: a force without any has no FRF
    relative = scaled_by(projected, powers(forces.input_spectra))
    driven = np.linalg.svd(relative, compute_uv=False, hermitian=True)[:, -1]
    valid = (driven > RECORDINGS.independent) & (spectra.n_segments >= len(r))
    if not valid.any():
        raise InputError("the instruments do not drive the forces on any line; choose others or average more")
    values = np.zeros((len(valid), len(spectra.responses), len(f)), dtype=complex)
    numerator = spectra.cross_spectra[:, :, r] @ inverse @ _adjoint(s_fr)
    values[valid] = numerator[valid] @ np.linalg.inv(projected[valid])
    return _frf_of_equation_error(forces, values, valid, projected)


def _independent_lines(spectra: CrossSpectra) -> NDArray[np.bool_]:
    valid = independent_lines(spectra)
    if not valid.any():
        n_inputs = len(spectra.excitations)
        raise InputError(
            f"the {n_inputs} inputs are dependent on every line ({spectra.n_tests} tests, {spectra.n_segments} "
            f"segments): give at least {n_inputs} tests with different immersions, or shorter segments"
        )
    return valid


def _noise_powers(spectra: Complex, given: Real | None, role: str) -> Real:
    power = powers(spectra).mean(axis=0) if given is None else np.asarray(given, dtype=float)
    if power.shape != (spectra.shape[1],) or not (np.isfinite(power).all() and (power > 0).all()):
        raise InputError(f"{role} noise powers {power.tolist()} must be {spectra.shape[1]} positive numbers")
    return power


def _adjoint(matrices: Complex) -> Complex:
    return np.asarray(matrices.conj().transpose(0, 2, 1))


def _inverse(matrices: Complex, valid: NDArray[np.bool_]) -> Complex:
    """Invert the matrices (n_lines, n, n) on valid lines; give zero on other lines."""
    inverse = np.zeros_like(matrices)
    inverse[valid] = np.linalg.inv(matrices[valid])
    return inverse


def _coherence(spectra: CrossSpectra, values: Complex, valid: NDArray[np.bool_]) -> Real:
    """Compute the multiple coherence from H on valid lines, and by the slower pseudo-inverse on other lines."""
    explained = np.real(np.einsum("kpq,kpq->kp", values, spectra.cross_spectra.conj()))
    coherence = explained_share(explained, spectra)
    coherence[~valid] = multiple_coherence(lines_of(spectra, ~valid))
    return coherence


def _frf_of_equation_error(spectra: CrossSpectra, values: Complex, valid: NDArray[np.bool_], driving: Complex) -> Frf:
    """Make an FRF whose covariance is that of the error ``X - H F`` over the input spectra ``driving``."""
    mixed = values @ _adjoint(spectra.cross_spectra)
    error = spectra.output_spectra - mixed - _adjoint(mixed)
    error = error + values @ spectra.input_spectra @ _adjoint(values)
    return _frf(spectra, values, valid, error, _inverse(driving, valid), multiple_coherence(spectra))


def _frf(
    spectra: CrossSpectra,
    values: Complex,
    valid: NDArray[np.bool_],
    residual: Complex,
    inverse: Complex,
    coherence: Real,
) -> Frf:
    """Make an FRF with its covariance, from the spectra of the residual and the inverse of the input spectra.

    The covariance is computed in the memory of ``residual``.
    """
    averages, n_inputs = spectra.effective_averages, len(spectra.excitations)
    covariance = None
    if averages > n_inputs + 0.5:  # else no degree of freedom is left for the noise
        # Hermitian up to rounding; each input takes a degree of freedom
        factor, step = averages / (averages - n_inputs) / 2, line_step(residual)
        for start in range(0, len(residual), step):
            here = residual[start : start + step]
            here += _adjoint(here)
            here *= factor
        residual[~valid] = 0.0
        covariance = FrfCovariance(residual, inverse.conj() / averages)
    width = spectral_width(spectra.settings, spectra.sample_rate)
    return frf_of_channels(
        spectra.frequencies, values, spectra.responses, spectra.excitations, valid, covariance, coherence, width
    )


def local_half_width(n_tests: int, n_excitations: int, degree: int = 2) -> int:
    """Return how many lines on either side of a line are fitted with it: the fewest that give 8 spare equations.

    Windows of neighbouring lines share most of their 2 n + 1 lines, so that their errors are correlated.

    Examples
    --------
    >>> local_half_width(3, 3), local_half_width(1, 1)
    (4, 7)
    """
    unknowns = (degree + 1) * (n_excitations + n_tests)
    return int(np.ceil(((unknowns + FRFS.spare_equations) / n_tests - 1) / 2))


def local_polynomial(
    recordings: Sequence[BandRecording], band: tuple[float, float], *, degree: int = 2, half_width: int | None = None
) -> Frf:
    """Estimate the FRF matrix without leakage on every Fourier line of the recordings inside a band.

    Around line k, ``X(k+r) = (H_k + sum_s h_s r^s) F(k+r) + T_k + sum_s t_s r^s``: leakage is the transient T, as
    smooth in frequency as H, with separate coefficients for each recording. 2 n + 1 neighbouring lines of all
    recordings give H_k, T_k and the coefficients by least squares; the residual gives the noise (Pintelon & Schoukens,
    System Identification, 2nd ed., section 7.2). Forces must be rough in frequency: random, or steps and bursts, not a
    slow sweep alone.

    Parameters
    ----------
    recordings
        One recording for each test; all are cut to the shortest.
    band : Hz
        Lowest and highest frequency of the lines.
    degree
        Degree of the polynomials.
    half_width
        Number n of lines on either side; None: the smallest number that gives at least 8 equations more than unknowns.

    Returns
    -------
    Frf
        Lines whose local forces are dependent are zero and not ``valid``.

    Raises
    ------
    InputError
        No recording, unlike channels, a band outside the recordings, or fewer lines than the window needs.
    """
    _check_recordings(recordings, band, degree)
    first, n_samples = recordings[0], min(len(recording.force) for recording in recordings)
    frequencies = np.fft.rfftfreq(n_samples, 1 / first.rate)
    forces = np.array([_fourier_lines(recording.force, n_samples) for recording in recordings])
    motions = np.array([_fourier_lines(recording.response, n_samples) for recording in recordings])
    n_tests, _, n_excitations = forces.shape
    unknowns = (degree + 1) * (n_excitations + n_tests)
    n = half_width or local_half_width(n_tests, n_excitations, degree)
    inside = np.flatnonzero((frequencies >= band[0]) & (frequencies <= band[1]))
    if len(inside) == 0 or len(frequencies) < 2 * n + 1:
        raise InputError(
            f"{len(inside)} lines between {band[0]:g} and {band[1]:g} Hz in recordings of "
            f"{n_samples / first.rate:.3g} s; the window needs {2 * n + 1}. Record longer"
        )
    if (2 * n + 1) * n_tests <= unknowns:
        raise InputError(f"half width {n} gives fewer equations than the {unknowns} unknowns; raise it")
    # each line has other regressors: 2048 lines at a time, to limit memory
    pieces = [_solved(forces, motions, inside[k : k + 2048], n, degree) for k in range(0, len(inside), 2048)]
    values, noise, excitation, valid = (np.concatenate(piece) for piece in zip(*pieces, strict=True))
    f, covariance = np.asarray(frequencies[inside]), FrfCovariance(noise, excitation)
    return frf_of_channels(f, values, first.responses, first.excitations, valid, covariance)


def _check_recordings(recordings: Sequence[BandRecording], band: tuple[float, float], degree: int) -> None:
    if not recordings:
        raise InputError("no recording; give at least one")
    first, *others = [(each.rate, each.excitations, each.responses) for each in recordings]
    if any(other != first for other in others):
        raise InputError("recordings of different channels or sample rates cannot be stacked; prepare them alike")
    highest = recordings[0].usable_band
    if not 0 <= band[0] < band[1] <= highest:
        raise InputError(f"band {band[0]:g} to {band[1]:g} Hz is not within 0 to {highest:g} Hz; choose a band inside")
    if degree < 0:
        raise InputError(f"degree {degree} is negative; give 0 or more")


def _fourier_lines(samples: Real, n_samples: int) -> Complex:
    return np.asarray(np.fft.rfft(samples[:n_samples] - samples[:n_samples].mean(axis=0), axis=0) / np.sqrt(n_samples))


def _solved(
    forces: Complex, motions: Complex, lines: Index, n: int, degree: int
) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """Return H, noise covariance, excitation factor of the covariance, and validity on the chosen lines.

    Lines whose local forces are dependent have H = 0 and are not valid.
    """
    centre = np.clip(lines, n, forces.shape[1] - 1 - n)  # at either end of the spectrum the window is one-sided
    window = centre[:, None] + np.arange(-n, n + 1)
    design = _design(forces[:, window], (window - lines[:, None]) / max(n, 1), degree)
    target = motions[:, window].transpose(1, 0, 2, 3).reshape(len(lines), -1, motions.shape[2])
    # columns of unit length, so that the test of rank does not depend on the units of the forces
    size = np.linalg.norm(design, axis=1, keepdims=True)
    scaled = design / np.where(size > 0, size, 1.0)
    orthogonal, triangle = np.linalg.qr(scaled)
    diagonal = np.abs(np.einsum("kii->ki", triangle))
    valid = (diagonal.min(axis=1) > 1e-6) & (size[:, 0] > 0).all(axis=1)
    # regular on all lines, so that all can be solved at once
    triangle[~valid] = np.eye(triangle.shape[1])
    projected = _adjoint(orthogonal) @ target
    residual = target - orthogonal @ projected
    noise = residual.transpose(0, 2, 1) @ residual.conj() / (design.shape[1] - design.shape[2])
    scale = size[:, 0, : forces.shape[2], None]
    inverse = np.linalg.inv(triangle)[:, : forces.shape[2]] / scale
    values = (np.linalg.solve(triangle, projected)[:, : forces.shape[2]] / scale).transpose(0, 2, 1)
    values[~valid] = 0.0
    return np.ascontiguousarray(values), noise, inverse @ _adjoint(inverse), valid


def _design(forces: Complex, offset: Real, degree: int) -> Complex:
    """Return the regressors (n_lines, n_tests * window, unknowns): for H, then its slopes, then the transients."""
    n_tests, n_lines, window = forces.shape[:3]
    factors = offset[:, :, None] ** np.arange(degree + 1)
    driven = np.einsum("tkwq,kws->ktwsq", forces, factors).reshape(n_lines, n_tests, window, -1)
    transient = np.einsum("tu,kws->ktwus", np.eye(n_tests), factors).reshape(n_lines, n_tests, window, -1)
    joint = np.concatenate([driven, transient.astype(complex)], axis=3)
    return np.asarray(joint.reshape(n_lines, n_tests * window, -1))
