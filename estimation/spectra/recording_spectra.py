"""Averaged spectra of recordings, read block by block."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from acquisition import Channel, Recording, RecordingFile, Stream, opened, path_of
from millfrf.core import Band, InputError
from millfrf.core.progress import progress

from ..band_recordings.band_recording import BandRecording
from ..settings import RECORDINGS
from .cross_spectra import CrossSpectra, SpectralSettings, count_segments, hop_length, settings_for, spectra_in_band
from .trusted_samples import usable_samples
from .welch import SpectralAccumulator

EXCITING = ("force", "moment", "voltage")
RESPONDING = ("acceleration", "velocity", "displacement")
_BLOCK = 1 << 14  # samples read and judged at once; parts of a recording have the same blocks as the whole


def choose_channels(
    stream: Stream, excitations: Sequence[str] | None = None, responses: Sequence[str] | None = None
) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """Choose excitation and response channels, by name or by quantity.

    Parameters
    ----------
    stream
        Samples of an open recording.
    excitations, responses
        Names of the channels. None: forces, moments and voltages excite; accelerations, velocities and displacements
        respond.

    Raises
    ------
    InputError
        A channel that is missing, or none of the needed quantities.
    """
    chosen = []
    for names, quantities, role in ((excitations, EXCITING, "excites"), (responses, RESPONDING, "responds")):
        if names:
            channels = tuple(stream.channels[column] for column in stream.columns(names))
        else:
            channels = tuple(channel for channel in stream.channels if channel.quantity in quantities)
        if not channels:
            available = ", ".join(f"{channel.name} ({channel.quantity})" for channel in stream.channels)
            raise InputError(
                f"{stream.path.name}: no channel {role} ({' or '.join(quantities)} is needed); it has {available}. "
                "Name the channels to use"
            )
        chosen.append(channels)
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
    """Compute Welch spectra of one recording, or of a part of it.

    Parameters
    ----------
    recording
        Open recording to read.
    settings
        Segment length, overlap, window and detrending.
    stream
        Name of the sample clock; None: the only one.
    excitations, responses
        Names of the channels; None: chosen by quantity, see :func:`choose_channels`.
    exclude_unusable
        Whether to leave out segments with overload, clipping, dropped or missing samples.
    segments
        First segment of a part and the segment after its last, counted from 0; None: all. :func:`join_parts` combines
        parts.
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        Missing channels, a record shorter than a segment, or samples that are not finite.
    """
    source = recording.stream(stream)
    exciting, responding = choose_channels(source, excitations, responses)
    n_excitations, channels = len(exciting), (*exciting, *responding)
    accumulator = SpectralAccumulator(exciting, responding, source.sample_rate, settings)
    columns = source.columns([channel.name for channel in channels])
    parts = [_adjacent(side) for side in (columns[:n_excitations], columns[n_excitations:])]
    start, stop = _span(source, settings, segments)
    try:
        for first in range(start - start % _BLOCK, stop, _BLOCK):
            block = source.read(first, min(first + _BLOCK, source.n_samples))
            # usable samples depend on the whole block, so that parts exclude the same samples as the whole
            usable = usable_samples(block[:, columns], channels) if exclude_unusable else None
            inside = slice(max(start - first, 0), min(stop - first, len(block)))
            excitation, response = (block[inside][:, part] for part in parts)
            accumulator.add(excitation, response, None if usable is None else usable[inside])
            if progress is not None:
                progress(min(first + len(block), stop) - start)
        return accumulator.finish()
    except InputError as error:
        raise InputError(f"{recording.path.name}: {error}") from error


def _adjacent(columns: list[int]) -> slice | list[int]:
    """Return columns as a slice, which copies nothing, where they stand next to each other in order."""
    first, last = columns[0], columns[-1] + 1
    return slice(first, last) if columns == list(range(first, last)) else columns


def _span(source: Stream, settings: SpectralSettings, segments: tuple[int, int] | None) -> tuple[int, int]:
    """Return the first sample of a part, and the sample after its last."""
    if segments is None:
        return 0, source.n_samples
    first, last = segments
    count = count_segments(source.n_samples, settings)
    if not 0 <= first < last <= count:
        raise InputError(f"{source.path.name}: segments {first} to {last} are requested, it has {count}")
    return first * hop_length(settings), (last - 1) * hop_length(settings) + settings.segment_length


@dataclass(frozen=True)
class AveragingSettings:
    """Settings by which the spectra of a test are computed.

    Parameters
    ----------
    segment : s
        Duration of a segment.
    overlap, window
        Overlap and window of the segments, as in :class:`estimation.SpectralSettings`.
    excitations, responses
        Names of the channels; empty: chosen by quantity.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    stream
        Name of the sample clock; None: the only one.
    exclude
        Whether segments with overload, clipping or dropped samples are left out.
    """

    segment: float = 8.0
    overlap: float = 0.5
    window: str = "hann"
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    band: Band | None = None
    stream: str | None = None
    exclude: bool = False


def spectra_of_tests(recordings: Sequence[RecordingFile], settings: AveragingSettings) -> tuple[CrossSpectra, ...]:
    """Compute the spectra of recordings of one sample rate, one for each test.

    Raises
    ------
    InputError
        A file that cannot be used, or sample rates that differ.
    """
    spectra = tuple(spectra_of_test(recording, settings) for recording in recordings)
    check_equal_rates([path_of(recording).name for recording in recordings], [test.sample_rate for test in spectra])
    return spectra


def spectra_of_test(
    recording: RecordingFile, settings: AveragingSettings, segments: tuple[int, int] | None = None
) -> CrossSpectra:
    """Compute the spectra of one recording.

    Parameters
    ----------
    recording
        Forces and responses of one test.
    settings
        Channels, segments and band of the spectra.
    segments
        First segment, and the segment after the last, counted from 0; None: all.
    """
    with opened(recording) as source:
        stream = source.stream(settings.stream)
        spectral = settings_for(stream.sample_rate, settings.segment, overlap=settings.overlap, window=settings.window)
        with progress(f"spectra of {source.path.name}", stream.n_samples) as update:
            spectra = cross_spectra(
                source,
                spectral,
                stream=settings.stream,
                excitations=settings.excitations,
                responses=settings.responses,
                exclude_unusable=settings.exclude,
                segments=segments,
                progress=update,
            )
    return spectra if settings.band is None else spectra_in_band(spectra, settings.band)


def check_equal_rates(names: Sequence[str], rates: Sequence[float]) -> None:
    """Refuse tests, given by their names, whose sample rates (Hz) differ."""
    for name, rate in zip(names, rates, strict=True):
        if rate != rates[0]:
            raise InputError(
                f"{name} was sampled at {rate:g} Hz, {names[0]} at {rates[0]:g} Hz; stack tests of one sample rate"
            )


def spectra_for_judging(recordings: Sequence[BandRecording]) -> tuple[CrossSpectra, ...]:
    """Compute spectra by which the independence of inputs is judged, one for each recording of a set-up.

    The recordings together hold at least two segments per input, of at most 8 s: longer segments leave too few averages
    to show whether inputs depend on each other.
    """
    n_inputs = len(recordings[0].excitations)
    shortest = min(recording.duration for recording in recordings)
    seconds = min(RECORDINGS.judged_segment, shortest, shortest * len(recordings) / (2 * n_inputs))
    return tuple(
        _hann_spectra(recording, max(seconds, RECORDINGS.shortest_segment / recording.rate)) for recording in recordings
    )


def _hann_spectra(recording: BandRecording, seconds: float) -> CrossSpectra:
    settings = settings_for(recording.rate, seconds, window="hann")
    accumulator = SpectralAccumulator(recording.excitations, recording.responses, recording.rate, settings)
    accumulator.add(recording.force, recording.response)
    return accumulator.finish()
