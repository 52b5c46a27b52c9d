"""FRF of whole records by local polynomials: no segments, no window, no leakage."""

import os
from collections.abc import Sequence
from pathlib import Path

from acquisition import Recording
from estimation import (
    BandRecord,
    CrossSpectra,
    Frf,
    SpectralAccumulator,
    band_record,
    choose_channels,
    local_polynomial,
    settings_for,
)
from foundation import Band, InputError

from ...progress import Watch

LONGEST = 8.0
"""Longest segment of the spectra by which the inputs are judged, s."""


def band_records(
    paths: Sequence[str | os.PathLike[str]],
    names: tuple[Sequence[str], Sequence[str]],
    stream: str | None,
    highest: float,
    watch: Watch,
) -> tuple[BandRecord, ...]:
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
            with watch(f"reading {Path(path).name}", source.n_samples) as update:
                records.append(band_record(recording, highest, *channels, stream=stream, progress=update))
    for path, record in zip(paths, records, strict=True):
        if record.sample_rate != records[0].sample_rate:
            raise InputError(
                f"{Path(path).name} and {Path(paths[0]).name} have other sample rates; stack tests of one rate"
            )
    return tuple(records)


def judging_spectra(records: Sequence[BandRecord], band: Band) -> tuple[CrossSpectra, ...]:
    """Spectra of each record in the band, by which its inputs are judged; each input can have a segment of its own."""
    n_inputs = len(records[0].excitations)
    shortest = min(len(record.excitation_samples) / record.sample_rate for record in records)
    seconds = min(LONGEST, shortest, shortest * len(records) / (2 * n_inputs))
    return tuple(_spectra(record, max(seconds, 8 / record.sample_rate)) for record in records)


def _spectra(record: BandRecord, seconds: float) -> CrossSpectra:
    settings = settings_for(record.sample_rate, seconds, window="hann")
    accumulator = SpectralAccumulator(record.excitations, record.responses, record.sample_rate, settings)
    accumulator.add(record.excitation_samples, record.response_samples)
    return accumulator.finish()


def local_frf(records: Sequence[BandRecord], band: Band, watch: Watch) -> Frf:
    """The FRF on every Fourier line of the band."""
    with watch(f"local polynomials, {band[0]:g} to {band[1]:g} Hz"):
        return local_polynomial(records, band)
