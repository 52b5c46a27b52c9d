"""FRF of whole recordings by local polynomials: no segments, no window, no leakage."""

import os
from collections.abc import Sequence
from pathlib import Path

from acquisition import Recording
from estimation import BandRecording, Frf, band_of_channels, choose_channels, local_polynomial, require_room_for_band
from millfrf.core import Band, InputError

from ...progress import Progress


def require_room_for_recordings(
    paths: Sequence[str | os.PathLike[str]],
    names: tuple[Sequence[str], Sequence[str]],
    stream: str | None,
    highest: float,
) -> None:
    """Refuse recordings that :func:`band_recordings` has no memory for, before they are looked through.

    Parameters
    ----------
    paths
        Recordings that will be read.
    names
        Names of excitations and responses; empty: chosen by quantity.
    stream
        Sample clock; None: the only one of each recording.
    highest
        Upper end of the band, Hz.

    Raises
    ------
    InputError
        A recording is too long, has not the channels, or the band is beyond its sample rate.
    """
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            forces, motions = choose_channels(source, names[0] or None, names[1] or None)
            require_room_for_band(source, len(forces) + len(motions), highest)


def band_recordings(
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
    found = []
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            channels = choose_channels(source, names[0] or None, names[1] or None)
            with progress(f"reading {Path(path).name}", source.n_samples) as update:
                found.append(band_of_channels(source, *channels, highest, update))
    for path, one in zip(paths, found, strict=True):
        if one.rate != found[0].rate:
            raise InputError(
                f"{Path(path).name} and {Path(paths[0]).name} have other sample rates; stack tests of one rate"
            )
    return tuple(found)


def local_frf(recordings: Sequence[BandRecording], band: Band, progress: Progress) -> Frf:
    """The FRF on every Fourier line of the band."""
    with progress(f"local polynomials, {band[0]:g} to {band[1]:g} Hz"):
        return local_polynomial(recordings, band)
