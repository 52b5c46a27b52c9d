"""Whole-record Fourier lines of stacked tests: what a leakage-free fit works on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.band_records import BandRecord
from foundation import InputError

_DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}


@dataclass(frozen=True)
class RecordSpectra:
    """Discrete Fourier lines of all tests in one band, laid end to end.

    Each record is one segment without a window. Its leakage is no error here: it is the free decay of the
    modes from the record's start and end, a smooth function of frequency with the same poles, which the fit
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


def record_spectra(records: Sequence[BandRecord], band: tuple[float, float]) -> RecordSpectra:
    """Transform each record as a whole and keep the lines of ``band`` (Hz).

    A sensor's known first-order high-pass is divided out of its channel.

    Raises
    ------
    InputError
        No record, records whose channels differ, or a band outside what the records hold.
    """
    if not records:
        raise InputError("no record to fit; give at least one recording")
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    layout = (records[0].excitations, records[0].responses)
    parts = []
    for number, record in enumerate(records):
        if (record.excitations, record.responses) != layout:
            raise InputError(f"test {number + 1} has other channels than test 1; stack tests of one set-up only")
        if high > record.usable_band * (1 + 1e-9):
            raise InputError(f"band up to {high:g} Hz, but test {number + 1} is flat only to {record.usable_band:g} Hz")
        parts.append(_lines(record, band, number))
    responses = layout[1]
    unknown = [channel.name for channel in responses if channel.quantity not in _DERIVATIVES]
    derivative = np.array([_DERIVATIVES.get(channel.quantity, 0) for channel in responses])
    if unknown and len(unknown) != len(responses):
        raise InputError(f"channels {', '.join(unknown)} are no motion; fit motions and other quantities apart")
    s, test, excitation, response = (np.concatenate(column) for column in zip(*parts, strict=True))
    return RecordSpectra(s, test, excitation, response, derivative)


def _lines(record: BandRecord, band: tuple[float, float], number: int) -> tuple[NDArray[np.generic], ...]:
    n = len(record.excitation_samples)
    frequencies = np.fft.rfftfreq(n, 1 / record.sample_rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    if inside.sum() < 8:
        raise InputError(
            f"test {number + 1} lasts {n / record.sample_rate:.3g} s: {inside.sum()} lines between {band[0]:g} and "
            f"{band[1]:g} Hz are too few; record longer or widen the band"
        )
    s = 2j * np.pi * frequencies[inside]
    columns = []
    for samples, channels in (
        (record.excitation_samples, record.excitations),
        (record.response_samples, record.responses),
    ):
        lines = np.fft.rfft(samples, axis=0)[inside] / np.sqrt(n)
        for column, channel in enumerate(channels):
            if channel.high_pass_hz:
                corner = 2 * np.pi * channel.high_pass_hz
                lines[:, column] *= (s + corner) / s
        columns.append(lines)
    return s, np.full(len(s), number), columns[0], columns[1]
