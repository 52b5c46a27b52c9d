"""Cross spectra of a recording: which channels, and one pass over the file."""

from collections.abc import Callable, Sequence

from acquisition import Channel, Recording, Stream
from foundation import InputError

from .spectral_accumulator import SpectralAccumulator
from .spectral_matrix import CrossSpectra, SpectralSettings
from .trusted_samples import usable_samples
from .windows import hop_length

EXCITING = ("force", "moment", "voltage")
RESPONDING = ("acceleration", "velocity", "displacement")
_BLOCK = 1 << 14
"""Samples that are read and judged at once; parts of a recording keep to the same blocks."""


def choose_channels(
    stream: Stream, excitations: Sequence[str] | None = None, responses: Sequence[str] | None = None
) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """Excitation and response channels, by name or by quantity.

    Without names, forces, moments and voltages excite; accelerations, velocities and displacements respond.

    Raises
    ------
    InputError
        A name that is not there, or none of the needed quantities.
    """
    chosen = []
    for names, quantities, role in ((excitations, EXCITING, "excites"), (responses, RESPONDING, "responds")):
        if names:
            found = tuple(stream.channels[column] for column in stream.columns(names))
        else:
            found = tuple(channel for channel in stream.channels if channel.quantity in quantities)
        if not found:
            listed = ", ".join(f"{channel.name} ({channel.quantity})" for channel in stream.channels)
            raise InputError(
                f"{stream.path.name}: no channel {role} ({' or '.join(quantities[:3])} is needed); it has {listed}. "
                "Name the channels to use"
            )
        chosen.append(found)
    return chosen[0], chosen[1]


def cross_spectra(
    recording: Recording,
    settings: SpectralSettings,
    *,
    stream: str | None = None,
    excitations: Sequence[str] | None = None,
    responses: Sequence[str] | None = None,
    exclude_unusable: bool = False,
    segments: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> CrossSpectra:
    """Compute Welch spectra of one recording, or of a part of it, read once, block by block.

    Parameters
    ----------
    recording
        Open recording to read.
    settings
        Settings of the spectra: segment length, overlap, window, detrending.
    stream
        Name of the sample clock; None: the only one.
    excitations, responses
        Names of the channels; None: chosen by quantity, see :func:`choose_channels`.
    exclude_unusable
        Whether to leave out segments with overload, clipping, dropped or missing samples (:func:`usable_samples`).
    segments
        First segment of a part and the one after its last, counted from 0; None: all. :func:`join_parts` puts parts
        together.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        Channels that are not there, a record shorter than a segment, or samples that are not finite.
    """
    source = recording.stream(stream)
    exciting, responding = choose_channels(source, excitations, responses)
    accumulator = SpectralAccumulator(exciting, responding, source.sample_rate, settings)
    names = [channel.name for channel in (*exciting, *responding)]
    start, stop = _span(source, settings, segments)
    try:
        for first in range(start - start % _BLOCK, stop, _BLOCK):
            block = source.read(first, min(first + _BLOCK, source.n_samples), names)
            usable = usable_samples(block, (*exciting, *responding)) if exclude_unusable else None
            inside = slice(max(start - first, 0), min(stop - first, len(block)))
            kept = None if usable is None else usable[inside]
            accumulator.add(block[inside, : len(exciting)], block[inside, len(exciting) :], kept)
            if progress is not None:
                progress(min(first + len(block), stop) - start)
        return accumulator.finish()
    except InputError as error:
        raise InputError(f"{recording.path.name}: {error}") from error


def _span(source: Stream, settings: SpectralSettings, segments: tuple[int, int] | None) -> tuple[int, int]:
    """First sample of a part and the one after its last."""
    if segments is None:
        return 0, source.n_samples
    first, last = segments
    if not 0 <= first < last <= count_segments(source.n_samples, settings):
        raise InputError(
            f"{source.path.name}: segments {first} to {last} are asked for, it has "
            f"{count_segments(source.n_samples, settings)}"
        )
    return first * hop_length(settings), (last - 1) * hop_length(settings) + settings.segment_length


def count_segments(n_samples: int, settings: SpectralSettings) -> int:
    """Number of segments in a recording.

    Examples
    --------
    >>> count_segments(1000, SpectralSettings(200, 0.5)), count_segments(199, SpectralSettings(200, 0.5))
    (9, 0)
    """
    if n_samples < settings.segment_length:
        return 0
    return (n_samples - settings.segment_length) // hop_length(settings) + 1
