"""Fourier lines of whole recordings of stacked tests, and their noise on responses and forces."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

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
    """Estimate noise variances by maximum likelihood from the equation error ``X - H F`` of a fitted model.

    On each line ``E[e e^H] = diag(v) + H diag(w) H^H``: response noise v is flat over the band, force noise w is shaped
    by the structure. A force noise that is not significant stays, too: without it, forces that are nearly dependent
    would give biased FRFs (Pintelon & Schoukens, System Identification, 2nd ed., chapter 9).

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
    shrink = max(1 - n_unknowns / (2 * error.size), 0.1)
    tests = spectra.lines_of_tests
    variances = np.array([_variance_components(error[:, k] / np.sqrt(shrink), frf[..., k]) for k in tests])
    return NoiseLevels(variances[:, : len(error)], variances[:, len(error) :])


def _variance_components(error: Complex, frf: Complex) -> Real:
    """Solve for the noise variances of one test, responses first, by steps of Fisher's scoring.

    With the columns u of ``[1, H]`` the slope of the log-likelihood by a variance is ``|u^H V^-1 e|^2 - u^H V^-1 u``,
    and the information of two ``|u^H V^-1 u'|^2``, summed over the lines.
    """
    n_responses, n_lines = error.shape
    power = np.mean(np.abs(error) ** 2, axis=1)
    size = np.maximum(np.mean(np.abs(frf) ** 2, axis=2), 1e-300)
    levels = np.concatenate([power, np.min(power[:, None] / size, axis=0)]) / 2
    least = np.concatenate([1e-6 * power, 1e-12 * levels[n_responses:]])  # the covariance is inverted
    unit = np.broadcast_to(np.eye(n_responses, dtype=complex), (n_lines, n_responses, n_responses))
    columns, errors = np.concatenate([unit, frf.transpose(2, 0, 1)], axis=2), error.T[..., None]
    for _ in range(SETTINGS.scoring_steps):
        adjoint = columns.conj().swapaxes(1, 2)
        solved = np.linalg.solve(columns * levels @ adjoint, np.concatenate([columns, errors], axis=2))
        products = adjoint @ solved
        by_noise = np.abs(products[..., :-1]) ** 2
        slope = np.sum(np.abs(products[..., -1]) ** 2 - np.diagonal(products, axis1=1, axis2=2).real, axis=0) * levels
        information = by_noise.sum(axis=0) * np.outer(levels, levels)
        step = np.linalg.lstsq(information, slope, rcond=1e-12)[0]
        levels = np.maximum(levels * np.clip(1 + step, 0.1, 10.0), least)
        if step @ slope < SETTINGS.likelihood_gain:
            break
    return levels
