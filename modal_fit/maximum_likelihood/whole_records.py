"""Whole-recording Fourier lines of stacked tests: what a leakage-free fit works on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import DERIVATIVE_ORDERS, BandRecording, before_high_pass, derivative_orders, high_pass_corners
from foundation import InputError


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
