"""Fourier lines of whole recordings of stacked tests, and their noise on responses and forces."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import DERIVATIVE_ORDERS, BandRecording, before_high_pass, derivative_orders, high_pass_corners
from millfrf.core import InputError


@dataclass(frozen=True)
class RecordSpectra:
    """Discrete Fourier lines of all tests in one band, laid end to end.

    Each recording is one segment without a window. Its leakage is no error here: it is the free decay of the
    modes from the recording's start and end, a smooth function of frequency with the same poles, which the fit
    carries as unknowns (Pintelon & Schoukens, System Identification, 2nd ed., section 6.3.2).

    Parameters
    ----------
    s : (n_lines,), rad/s
        Laplace variable 2 pi i f of each line.
    test : (n_lines,), int
        Number of the test that each line comes from.
    excitation : (n_lines, n_excitations)
        DFT / sqrt(n_samples) of the excitations: white noise of variance v gives E|.|^2 = v.
    response : (n_lines, n_responses)
        DFT / sqrt(n_samples) of the responses.
    derivative : (n_responses,), int
        Number of times each response was differentiated: 2 for accelerations.
    """

    s: NDArray[np.complex128]
    test: NDArray[np.int64]
    excitation: NDArray[np.complex128]
    response: NDArray[np.complex128]
    derivative: NDArray[np.int64]

    @property
    def n_tests(self) -> int:
        """Number of stacked tests."""
        return int(self.test.max()) + 1


def record_spectra(recordings: Sequence[BandRecording], band: tuple[float, float]) -> RecordSpectra:
    """Transform each recording as a whole and keep the lines of ``band`` (Hz).

    A sensor's known first-order high-pass is divided out of its channel.

    Raises
    ------
    InputError
        No recording, recordings whose channels differ, or a band outside what the recordings hold.
    """
    if not recordings:
        raise InputError("no recording to fit; give at least one recording")
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    layout = (recordings[0].excitations, recordings[0].responses)
    parts = []
    for number, recording in enumerate(recordings):
        if (recording.excitations, recording.responses) != layout:
            raise InputError(f"test {number + 1} has other channels than test 1; stack tests of one set-up only")
        if high > recording.usable_band * (1 + 1e-9):
            raise InputError(
                f"band up to {high:g} Hz, but test {number + 1} is flat only to {recording.usable_band:g} Hz; "
                "lower the band's end"
            )
        parts.append(_lines(recording, band, number))
    responses = layout[1]
    unknown = [channel.name for channel in responses if channel.quantity not in DERIVATIVE_ORDERS]
    if unknown and len(unknown) != len(responses):
        raise InputError(f"channels {', '.join(unknown)} are no motion; fit motions and other quantities apart")
    s, test, excitation, response = (np.concatenate(column) for column in zip(*parts, strict=True))
    return RecordSpectra(s, test, excitation, response, derivative_orders(responses))


def _lines(recording: BandRecording, band: tuple[float, float], number: int) -> tuple[NDArray[np.generic], ...]:
    n = len(recording.force)
    frequencies = np.fft.rfftfreq(n, 1 / recording.rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    if inside.sum() < 8:
        raise InputError(
            f"test {number + 1} lasts {n / recording.rate:.3g} s: {inside.sum()} lines between {band[0]:g} and "
            f"{band[1]:g} Hz are too few; record longer or widen the band"
        )
    s = np.asarray(2j * np.pi * frequencies[inside], dtype=complex)
    columns = []
    for samples, channels in ((recording.force, recording.excitations), (recording.response, recording.responses)):
        lines = np.fft.rfft(samples, axis=0)[inside] / np.sqrt(n)
        columns.append(lines * before_high_pass(s, high_pass_corners(channels)))
    return s, np.full(len(s), number), columns[0], columns[1]


_SIGNIFICANT = 3.0  # standard errors


@dataclass(frozen=True)
class NoiseLevels:
    """Variance of the noise on a Fourier line, per test and channel.

    Parameters
    ----------
    response : (n_tests, n_responses), unit^2
        Noise variance of each response.
    excitation : (n_tests, n_excitations), unit^2
        Noise variance of each excitation.
    """

    response: NDArray[np.float64]
    excitation: NDArray[np.float64]

    def covariance(self, frf: NDArray[np.complex128], test: NDArray[np.int64]) -> NDArray[np.complex128]:
        """``V = diag(response) + H diag(excitation) H^H`` of the equation error ``X - H F`` on every line."""
        passed = np.einsum("kpq,kq,kuq->kpu", frf, self.excitation[test], frf.conj(), optimize=True)
        diagonal = np.einsum("kp,pu->kpu", self.response[test], np.eye(frf.shape[1]))
        return np.asarray(passed + diagonal)


def flat_noise(error: NDArray[np.complex128], test: NDArray[np.int64], n_excitations: int) -> NoiseLevels:
    """All of the error taken as flat noise on the responses; ``error`` (n_lines, n_responses)."""
    n_tests = int(test.max()) + 1
    response = np.array([np.mean(np.abs(error[test == number]) ** 2, axis=0) for number in range(n_tests)])
    return NoiseLevels(response, np.zeros((n_tests, n_excitations)))


def noise_levels(
    error: NDArray[np.complex128],
    frf: NDArray[np.complex128],
    test: NDArray[np.int64],
    n_tests: int,
    n_unknowns: int,
) -> NoiseLevels:
    """Estimate noise variances from the equation error ``X - H F`` of a fitted model.

    On each line ``E|error_p|^2 = v_p + sum_q |H_pq|^2 w_q``: response noise is flat over the band, force
    noise comes out shaped by the structure. Non-negative least squares, reweighted by the squared mean that an
    exponentially distributed power has (Pintelon & Schoukens, System Identification, 2nd ed., chapter 9).

    Parameters
    ----------
    error : (n_lines, n_responses)
        Equation error of the fitted model on each line.
    frf : (n_lines, n_responses, n_excitations)
        FRF of the fitted model on each line.
    test : (n_lines,), int
        Number of the test that each line comes from.
    n_tests
        Number of tests.
    n_unknowns
        Number of real unknowns already fitted: they took their share of the error.
    """
    n_lines, n_responses = error.shape
    shrink = 1 - n_unknowns / (2 * n_lines * n_responses)
    power = np.abs(error) ** 2 / max(shrink, 0.1)
    gain = np.abs(frf) ** 2
    response = np.empty((n_tests, n_responses))
    excitation = np.empty((n_tests, frf.shape[2]))
    for number in range(n_tests):
        mine = test == number
        solved = _variance_components(power[mine], gain[mine])
        response[number], excitation[number] = solved[:n_responses], solved[n_responses:]
    return NoiseLevels(response, excitation)


def _variance_components(power: NDArray[np.float64], gain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve for (v_1..v_p, w_1..w_q) of one test; a force noise that does not show is taken as zero."""
    n_lines, n_responses, n_excitations = gain.shape
    flat = np.broadcast_to(np.eye(n_responses), (n_lines, n_responses, n_responses))
    design = np.concatenate([flat, gain], axis=2).reshape(-1, n_responses + n_excitations)
    observed = power.reshape(-1)
    mean = power.mean(axis=0)
    kept = np.arange(n_responses + n_excitations)
    while True:
        solved, errors = _reweighted(design[:, kept], observed, np.tile(mean, n_lines))
        force = kept >= n_responses
        weakest = np.argmin(np.where(force, solved / errors, np.inf))
        if not force.any() or solved[weakest] > _SIGNIFICANT * errors[weakest]:
            break
        kept = np.delete(kept, weakest)
    levels = np.zeros(n_responses + n_excitations)
    levels[kept] = solved
    levels[:n_responses] = np.maximum(levels[:n_responses], 1e-6 * mean)
    return levels


def _reweighted(
    design: NDArray[np.float64], observed: NDArray[np.float64], expected: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Non-negative least squares with weights 1 / mean^2, and standard errors of the components."""
    scale = np.linalg.norm(design, axis=0)
    floor = 1e-3 * expected
    for _ in range(8):
        weighted = design / scale / expected[:, None]
        solved, _ = scipy.optimize.nnls(weighted, observed / expected)
        expected = np.maximum(design @ (solved / scale), floor)
    weighted = design / scale / expected[:, None]
    variance = np.diag(np.linalg.pinv(weighted.T @ weighted))
    return solved / scale, np.sqrt(variance) / scale
