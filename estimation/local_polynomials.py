"""FRF of short recordings without leakage: local polynomials in frequency for the FRF and for the transient."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError

from .band_recordings.band_recording import BandRecording
from .frf.frf_matrix import Frf, FrfCovariance
from .frf.quantities import frf_quantity

_LINES_AT_ONCE = 2048


def local_half_width(n_tests: int, n_excitations: int, degree: int = 2) -> int:
    """Lines to either side of each that are fitted together: the fewest with 8 equations more than unknowns.

    Neighbouring lines share most of their window of 2 n + 1 lines, so that their errors are correlated.

    Examples
    --------
    >>> local_half_width(3, 3), local_half_width(1, 1)
    (4, 7)
    """
    unknowns = (degree + 1) * (n_excitations + n_tests)
    return int(np.ceil(((unknowns + 8) / n_tests - 1) / 2))


def local_polynomial(
    recordings: Sequence[BandRecording], band: tuple[float, float], *, degree: int = 2, half_width: int | None = None
) -> Frf:
    """Estimate the FRF matrix on every Fourier line of the recordings inside ``band`` (Hz).

    Around line k, ``X(k+r) = (H_k + sum_s h_s r^s) F(k+r) + T_k + sum_s t_s r^s``: leakage is the transient T, as
    smooth in frequency as H, one for each recording. 2 n + 1 neighbouring lines of all recordings give H_k, T_k and the
    coefficients by least squares; the misfit gives the noise (Pintelon & Schoukens, System Identification, 2nd ed.,
    section 7.2). Forces must be rough in frequency: random, or steps and bursts, not a slow sweep alone.

    Parameters
    ----------
    recordings
        One recording for each test; all are cut to the shortest.
    band : Hz
        Lowest and highest frequency of the lines.
    degree
        Degree of the polynomials.
    half_width
        Number n of lines on either side; None: the smallest with at least 8 equations more than unknowns.

    Returns
    -------
    Frf
        Lines whose local forces are dependent are zero and not ``valid``.

    Raises
    ------
    InputError
        No recording, unlike channels, a band outside the recordings, or fewer lines than the window needs.
    """
    _check(recordings, band, degree)
    n_samples = min(len(recording.force) for recording in recordings)
    frequencies = np.fft.rfftfreq(n_samples, 1 / recordings[0].rate)
    forces = np.array([_lines(recording.force, n_samples) for recording in recordings])
    motions = np.array([_lines(recording.response, n_samples) for recording in recordings])
    n_tests, _, n_excitations = forces.shape
    unknowns = (degree + 1) * (n_excitations + n_tests)
    n = half_width or local_half_width(n_tests, n_excitations, degree)
    inside = np.flatnonzero((frequencies >= band[0]) & (frequencies <= band[1]))
    if len(inside) == 0 or len(frequencies) < 2 * n + 1:
        raise InputError(
            f"{len(inside)} lines between {band[0]:g} and {band[1]:g} Hz in recordings of "
            f"{n_samples / recordings[0].rate:.3g} s; the window needs {2 * n + 1}. Record longer"
        )
    if (2 * n + 1) * n_tests <= unknowns:
        raise InputError(f"half width {n} gives fewer equations than the {unknowns} unknowns; raise it")
    values, noise, excitation, valid = _in_pieces(forces, motions, inside, n, degree)
    quantity, unit = frf_quantity(recordings[0].responses, recordings[0].excitations)
    return Frf(
        np.asarray(frequencies[inside]),
        values,
        tuple(channel.degree_of_freedom for channel in recordings[0].responses),
        tuple(channel.degree_of_freedom for channel in recordings[0].excitations),
        quantity,
        unit,
        valid,
        None,
        FrfCovariance(noise, excitation),
    )


def _in_pieces(
    forces: Complex, motions: Complex, inside: NDArray[np.int64], n: int, degree: int
) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """Solve around each line; some thousand lines at a time, because each has regressors of its own."""
    pieces = []
    for first in range(0, len(inside), _LINES_AT_ONCE):
        lines = inside[first : first + _LINES_AT_ONCE]
        centre = np.clip(lines, n, forces.shape[1] - 1 - n)  # at either end of the spectrum the window is one-sided
        around = centre[:, None] + np.arange(-n, n + 1)
        offset = (around - lines[:, None]) / max(n, 1)
        design = _design(forces[:, around], offset, degree)
        target = motions[:, around].transpose(1, 0, 2, 3).reshape(len(lines), -1, motions.shape[2])
        pieces.append(_solve(design, target, forces.shape[2]))
    values, noise, excitation, valid = (np.concatenate(each) for each in zip(*pieces, strict=True))
    return values, noise, excitation, valid


def _check(recordings: Sequence[BandRecording], band: tuple[float, float], degree: int) -> None:
    if not recordings:
        raise InputError("no recording; give at least one")
    first = recordings[0]
    for recording in recordings:
        if (recording.rate, recording.excitations, recording.responses) != (
            first.rate,
            first.excitations,
            first.responses,
        ):
            raise InputError("recordings of different channels or sample rates cannot be stacked; prepare them alike")
    if not 0 <= band[0] < band[1] <= first.usable_band:
        raise InputError(
            f"band {band[0]:g} to {band[1]:g} Hz is not within 0 to {first.usable_band:g} Hz; choose a band inside"
        )
    if degree < 0:
        raise InputError(f"degree {degree} is negative; give 0 or more")


def _lines(samples: NDArray[np.float64], n_samples: int) -> Complex:
    return np.asarray(np.fft.rfft(samples[:n_samples] - samples[:n_samples].mean(axis=0), axis=0) / np.sqrt(n_samples))


def _design(forces: Complex, offset: NDArray[np.float64], degree: int) -> Complex:
    """Regressors (n_lines, n_tests * window, unknowns): H first, then its slopes, then the transients."""
    n_tests, n_lines, window = forces.shape[:3]
    powers = offset[:, :, None] ** np.arange(degree + 1)
    driven = np.einsum("tkwq,kws->ktwsq", forces, powers).reshape(n_lines, n_tests, window, -1)
    own = np.einsum("tu,kws->ktwus", np.eye(n_tests), powers).reshape(n_lines, n_tests, window, -1)
    both = np.concatenate([driven, own.astype(complex)], axis=3)
    return np.asarray(both.reshape(n_lines, n_tests * window, -1))


def _solve(design: Complex, target: Complex, n_excitations: int) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """H, noise covariance, excitation factor of the covariance, and which lines have independent forces."""
    size = np.linalg.norm(design, axis=1, keepdims=True)
    scaled = design / np.where(size > 0, size, 1.0)
    orthogonal, triangle = np.linalg.qr(scaled)
    diagonal = np.abs(np.einsum("kii->ki", triangle))
    valid = (diagonal.min(axis=1) > 1e-6) & (size[:, 0] > 0).all(axis=1)
    triangle[~valid] = np.eye(triangle.shape[1])
    projected = orthogonal.conj().transpose(0, 2, 1) @ target
    solution = np.linalg.solve(triangle, projected)
    misfit = target - orthogonal @ projected
    freedom = design.shape[1] - design.shape[2]
    noise = misfit.transpose(0, 2, 1) @ misfit.conj() / freedom
    inverse = np.linalg.inv(triangle)[:, :n_excitations] / size[:, 0, :n_excitations, None]
    excitation = inverse @ inverse.conj().transpose(0, 2, 1)
    values = (solution[:, :n_excitations] / size[:, 0, :n_excitations, None]).transpose(0, 2, 1)
    values[~valid] = 0.0
    return np.ascontiguousarray(values), noise, excitation, valid
