"""Fourier lines of whole recordings of stacked tests, and their noise on responses and forces."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from estimation import DERIVATIVE_ORDERS, BandRecording, before_high_pass, derivative_orders, high_pass_corners
from millfrf.core import Band, Complex, Index, InputError, Real

from ..settings import SETTINGS


@dataclass(frozen=True)
class RecordSpectra:
    """Discrete Fourier lines of all tests in one band, one test after the other.

    Each recording is one segment without a window. Its leakage is no error: it is the free decay of the modes from the
    recording's start and end, a smooth function of frequency with the same poles, which the fit includes as unknowns
    (Pintelon & Schoukens, System Identification, 2nd ed., section 6.3.2). Lines are DFT / sqrt(n_samples): white noise
    of variance v gives E|.|^2 = v.
    """

    s: Complex  # (n_lines,), rad/s: Laplace variable 2 pi i f
    test: Index  # (n_lines,): number of the test of each line
    excitation: Complex  # (n_lines, n_excitations)
    response: Complex  # (n_lines, n_responses)
    derivative: Index  # (n_responses,): how often each response was differentiated, 2 for accelerations

    @property
    def n_tests(self) -> int:
        """Return the number of stacked tests."""
        return int(self.test.max()) + 1

    @property
    def lines_of_tests(self) -> list[slice]:
        """Return the lines of each test."""
        edges = np.searchsorted(self.test, np.arange(self.n_tests + 1)).tolist()
        return [slice(first, last) for first, last in pairwise(edges)]


def record_spectra(recordings: Sequence[BandRecording], band: Band) -> RecordSpectra:
    """Transform each recording as a whole and keep the lines of ``band`` (Hz).

    A sensor's known first-order high-pass is divided out of its channel.

    Raises
    ------
    InputError
        No recording, recordings whose channels differ, or a band outside the band of the recordings.
    """
    if not recordings:
        raise InputError("no recording to fit; give at least one recording")
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    layout = (recordings[0].excitations, recordings[0].responses)
    tests = []
    for number, recording in enumerate(recordings):
        if (recording.excitations, recording.responses) != layout:
            raise InputError(f"test {number + 1} has other channels than test 1; stack tests of one set-up only")
        if high > recording.usable_band * (1 + 1e-9):
            raise InputError(
                f"band up to {high:g} Hz, but test {number + 1} is flat only to {recording.usable_band:g} Hz; "
                "lower the upper edge of the band"
            )
        tests.append(_lines(recording, band, number))
    responses = layout[1]
    no_motions = [channel.name for channel in responses if channel.quantity not in DERIVATIVE_ORDERS]
    if no_motions and len(no_motions) != len(responses):
        raise InputError(f"channels {', '.join(no_motions)} are no motion; fit motions and other quantities separately")
    s, test, excitation, response = (np.concatenate(column) for column in zip(*tests, strict=True))
    return RecordSpectra(s, test, excitation, response, derivative_orders(responses))


def _lines(recording: BandRecording, band: Band, number: int) -> tuple[Complex, Index, Complex, Complex]:
    n = len(recording.force)
    frequencies = np.fft.rfftfreq(n, 1 / recording.rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    if inside.sum() < SETTINGS.fewest_lines:
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


@dataclass(frozen=True)
class NoiseLevels:
    """Variance of the noise on a Fourier line, per test and channel."""

    response: Real  # (n_tests, n_responses), unit^2
    excitation: Real  # (n_tests, n_excitations), unit^2


def flat_noise(error: Complex, spectra: RecordSpectra) -> NoiseLevels:
    """Take all of the error (n_responses, n_lines) as flat noise on the responses."""
    response = np.array([np.mean(np.abs(error[:, lines]) ** 2, axis=1) for lines in spectra.lines_of_tests])
    return NoiseLevels(response, np.zeros((len(response), spectra.excitation.shape[1])))


def noise_levels(error: Complex, frf: Complex, spectra: RecordSpectra, n_unknowns: int) -> NoiseLevels:
    """Estimate noise variances from the equation error ``X - H F`` of a fitted model.

    On each line ``E|error_p|^2 = v_p + sum_q |H_pq|^2 w_q``: response noise v is flat over the band, force
    noise w is shaped by the structure. v and w are solved for by non-negative least squares, weighted by 1 / mean^2
    as for an exponentially distributed power (Pintelon & Schoukens, System Identification, 2nd ed., chapter 9).

    Parameters
    ----------
    error : (n_responses, n_lines)
        Equation error of the fitted model on each line.
    frf : (n_responses, n_excitations, n_lines)
        FRF of the fitted model on each line.
    spectra
        The lines of all tests.
    n_unknowns
        Number of real unknowns already fitted; they have made the error smaller, which is corrected.
    """
    shrink = 1 - n_unknowns / (2 * error.size)
    power = np.abs(error) ** 2 / max(shrink, 0.1)
    gain = np.abs(frf) ** 2
    variances = np.array([_variance_components(power[:, k], gain[..., k]) for k in spectra.lines_of_tests])
    return NoiseLevels(variances[:, : len(error)], variances[:, len(error) :])


def _variance_components(power: Real, gain: Real) -> Real:
    """Solve for the noise variances of one test, responses first; insignificant force noise is set to zero."""
    n_responses, n_excitations, n_lines = gain.shape
    design = np.zeros((n_responses, n_lines, n_responses + n_excitations))
    design[np.arange(n_responses), :, np.arange(n_responses)] = 1.0
    design[..., n_responses:] = gain.swapaxes(1, 2)
    design, observed, mean = design.reshape(power.size, -1), power.ravel(), power.mean(axis=1)
    columns = np.arange(n_responses + n_excitations)
    while True:
        solution, errors = _reweighted(design[:, columns], observed, np.repeat(mean, n_lines))
        is_force = columns >= n_responses
        weakest = np.argmin(np.where(is_force, solution / errors, np.inf))
        if not is_force.any() or solution[weakest] > SETTINGS.significant_noise * errors[weakest]:
            break
        columns = np.delete(columns, weakest)
    levels = np.zeros(n_responses + n_excitations)
    levels[columns] = solution
    levels[:n_responses] = np.maximum(levels[:n_responses], 1e-6 * mean)  # so that the covariance can be inverted
    return levels


def _reweighted(design: Real, observed: Real, expected: Real) -> tuple[Real, Real]:
    """Solve by non-negative least squares with weights 1 / mean^2; return the components and their standard errors."""
    scale = np.linalg.norm(design, axis=0)
    floor = 1e-3 * expected
    for _ in range(8):
        weighted = design / scale / expected[:, None]
        solution, _ = scipy.optimize.nnls(weighted, observed / expected)
        expected = np.maximum(design @ (solution / scale), floor)
    weighted = design / scale / expected[:, None]
    variance = np.diag(np.linalg.pinv(weighted.T @ weighted))
    return solution / scale, np.sqrt(variance) / scale
