"""FRF of whole records by local polynomials: no segments, no window, no leakage."""

import os
from collections.abc import Sequence
from pathlib import Path

from acquisition import Recording
from estimation import (
    BandRecording,
    CrossSpectra,
    Frf,
    SpectralAccumulator,
    band_of_channels,
    choose_channels,
    local_polynomial,
    settings_for,
)
from foundation import Band, InputError

from ...progress import Progress

LONGEST = 8.0
"""Longest segment of the spectra by which the inputs are judged, s."""


def band_records(
    paths: Sequence[str | os.PathLike[str]],
    names: tuple[Sequence[str], Sequence[str]],
    stream: str | None,
    highest: float,
    progress: Progress,
) -> tuple[BandRecording, ...]:
    """Read each recording up to ``highest`` (Hz).

    Parameters
    ----------
    names
        Names of excitations and responses; empty: chosen by quantity.

    Raises
    ------
    InputError
        Channels that are not there, a band beyond the sample rate, or rates that differ.
    """
    records = []
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            channels = choose_channels(source, names[0] or None, names[1] or None)
            with progress(f"reading {Path(path).name}", source.n_samples) as update:
                records.append(band_of_channels(source, *channels, highest, update))
    for path, record in zip(paths, records, strict=True):
        if record.rate != records[0].rate:
            raise InputError(
                f"{Path(path).name} and {Path(paths[0]).name} have other sample rates; stack tests of one rate"
            )
    return tuple(records)


def judging_spectra(records: Sequence[BandRecording], band: Band) -> tuple[CrossSpectra, ...]:
    """Spectra of each record in the band, by which its inputs are judged; each input can have a segment of its own."""
    n_inputs = len(records[0].excitations)
    shortest = min(len(record.force) / record.rate for record in records)
    seconds = min(LONGEST, shortest, shortest * len(records) / (2 * n_inputs))
    return tuple(_spectra(record, max(seconds, 8 / record.rate)) for record in records)


def _spectra(record: BandRecording, seconds: float) -> CrossSpectra:
    settings = settings_for(record.rate, seconds, window="hann")
    accumulator = SpectralAccumulator(record.excitations, record.responses, record.rate, settings)
    accumulator.add(record.force, record.response)
    return accumulator.finish()


def local_frf(records: Sequence[BandRecording], band: Band, progress: Progress) -> Frf:
    """The FRF on every Fourier line of the band."""
    with progress(f"local polynomials, {band[0]:g} to {band[1]:g} Hz"):
        return local_polynomial(records, band)
