"""Welch's averaged spectra of recordings, block by block in constant memory."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel, Recording, Stream
from millfrf.core import InputError

from ..band_recordings.band_recording import BandRecording
from .cross_spectra import (
    CrossSpectra,
    SpectralSettings,
    check_settings,
    effective_averages,
    hop_length,
    settings_for,
    window_samples,
)
from .trusted_samples import usable_samples

_BATCH_BYTES = 20 << 20  # of segments transformed at once
_MOST_SEGMENTS = 16
_WORKERS = 2
_PRODUCT_BYTES = 1 << 20  # of products of lines at once


class SpectralAccumulator:
    """Sums windowed cross spectra over segments as samples arrive.

    ``S_uv[k] = 2 / (fs sum w^2) * mean over segments of U_k conj(V_k)``, one-sided; lines 0 and Nyquist are not
    doubled (Welch 1967; Bendat & Piersol, Random Data, 4th ed., section 11.5). Known input delays of the channels are
    taken out of the result.

    Parameters
    ----------
    excitations, responses
        Channels along the columns of what ``add`` gets.
    sample_rate : Hz
        Samples a second.
    settings
        Settings of the spectra: segment length, overlap, window, detrending.

    Raises
    ------
    InputError
        Settings that cannot be used, or no channels.
    """

    def __init__(
        self,
        excitations: Sequence[Channel],
        responses: Sequence[Channel],
        sample_rate: float,
        settings: SpectralSettings,
    ) -> None:
        check_settings(settings)
        if not excitations or not responses:
            raise InputError("spectra need at least one excitation and one response channel; name them")
        self.excitations, self.responses = tuple(excitations), tuple(responses)
        self.sample_rate, self.settings = sample_rate, settings
        self.n_segments = 0
        self._window = window_samples(settings)
        self._hop = hop_length(settings)
        width = len(self.excitations) + len(self.responses)
        self._batch = max(1, min(_MOST_SEGMENTS, _BATCH_BYTES // (8 * settings.segment_length * width)))
        self._sum = np.zeros((settings.segment_length // 2 + 1, width, width), dtype=complex)
        self._held = np.empty((width, 0))
        self._held_usable = np.empty(0, dtype=bool)
        self.n_excluded = 0

    def add(
        self,
        excitation_samples: NDArray[np.floating],
        response_samples: NDArray[np.floating],
        usable: NDArray[np.bool_] | None = None,
    ) -> None:
        """Take the next samples, (n, n_excitations) and (n, n_responses), any number of them.

        Segments that hold a sample which is not ``usable`` (n,) are left out and counted in ``n_excluded``.

        Raises
        ------
        InputError
            Unequal lengths, wrong numbers of columns, or samples that are not finite.
        """
        shapes = (np.shape(excitation_samples), np.shape(response_samples))
        n = shapes[0][0]
        if shapes != ((n, len(self.excitations)), (n, len(self.responses))):
            raise InputError(
                f"samples of shapes {shapes[0]} and {shapes[1]}, expected (n, {len(self.excitations)}) and "
                f"(n, {len(self.responses)}) of one length"
            )
        fresh = np.empty((self._held.shape[0], n))
        fresh[: len(self.excitations)] = np.asarray(excitation_samples).T
        fresh[len(self.excitations) :] = np.asarray(response_samples).T
        if usable is not None:
            fresh[:, ~usable] = 0.0
        if not np.isfinite(fresh.sum()):
            row = int(np.argmin(np.isfinite(fresh).all(axis=1)))
            name = (*self.excitations, *self.responses)[row].name
            raise InputError(f"channel {name} holds NaN or infinity; mend or convert the recording")
        samples = np.concatenate([self._held, fresh], axis=1) if self._held.shape[1] else fresh
        trusted = np.concatenate([self._held_usable, np.ones(n, dtype=bool) if usable is None else usable])
        ready = self._n_complete(samples.shape[1])
        taken = ready - ready % self._batch  # whole batches: the sums are read and written once for each
        self._add_batches(samples, trusted, taken)
        self._held = samples[:, taken * self._hop :].copy()
        self._held_usable = trusted[taken * self._hop :]

    def _n_complete(self, n_samples: int) -> int:
        length = self.settings.segment_length
        return (n_samples - length) // self._hop + 1 if n_samples >= length else 0

    def _add_batches(self, samples: NDArray[np.float64], trusted: NDArray[np.bool_], n_segments: int) -> None:
        for first in range(0, n_segments, self._batch):
            self._add_segments(samples, trusted, first, min(first + self._batch, n_segments))

    def _add_segments(self, samples: NDArray[np.float64], trusted: NDArray[np.bool_], first: int, last: int) -> None:
        """Transform segments first..last-1 of the channel-major ``samples`` and add the products of trusted ones."""
        view = np.lib.stride_tricks.sliding_window_view(samples, self.settings.segment_length, axis=1)
        segments = view[:, first * self._hop : (last - 1) * self._hop + 1 : self._hop]
        if not trusted.all():
            chosen = np.lib.stride_tricks.sliding_window_view(trusted, self.settings.segment_length)
            whole = chosen[first * self._hop : (last - 1) * self._hop + 1 : self._hop].all(axis=1)
            segments = segments[:, whole]
        self.n_segments += segments.shape[1]
        self.n_excluded += last - first - segments.shape[1]
        if segments.shape[1] == 0:
            return
        windowed = _detrended(segments, self.settings.detrend)
        windowed *= self._window
        step = max(1, _PRODUCT_BYTES // (16 * len(windowed) ** 2))

        def add_products(start: int) -> None:
            part = np.empty((min(step, len(self._sum) - start), *windowed.shape[:2]), dtype=complex)
            for row, channel in enumerate(lines):
                part[:, row] = channel[:, start : start + step].T
            self._sum[start : start + step] += part @ part.conj().transpose(0, 2, 1)

        with ThreadPoolExecutor(_WORKERS) as pool:  # transforms and products let go of the interpreter
            lines = list(pool.map(_transformed, windowed))
            list(pool.map(add_products, range(0, len(self._sum), step)))

    def result(self) -> CrossSpectra:
        """The spectra of what came so far; more samples may follow.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._add_remainder()
        return self._spectra(np.asarray(self._sum * self._scale()[:, None, None], dtype=np.complex128))

    def finish(self) -> CrossSpectra:
        """The spectra, in the accumulator's own memory: nothing can be added afterwards.

        Raises
        ------
        InputError
            Fewer samples than one segment, or none that is usable.
        """
        self._add_remainder()
        total, self._sum = self._sum, np.empty((0, 0, 0), dtype=complex)
        scale = self._scale(len(total))
        step = max(1, _PRODUCT_BYTES // (16 * max(1, total.shape[1]) ** 2))
        for start in range(0, len(total), step):
            total[start : start + step] *= scale[start : start + step, None, None]
        return self._spectra(total)

    def _add_remainder(self) -> None:
        """Segments that wait for their batch to fill."""
        ready = self._n_complete(self._held.shape[1])
        self._add_batches(self._held, self._held_usable, ready)
        self._held = self._held[:, ready * self._hop :].copy()
        self._held_usable = self._held_usable[ready * self._hop :]
        if self.n_segments == 0 and self.n_excluded:
            raise InputError(
                f"all {self.n_excluded} segments hold overload, clipping or dropped samples; record again with a "
                "lower gain, or use shorter segments"
            )
        if self.n_segments == 0:
            raise InputError(
                f"record is shorter than one segment of {self.settings.segment_length} samples "
                f"({self.settings.segment_length / self.sample_rate:g} s); use shorter segments or a longer record"
            )

    def _scale(self, n_lines: int | None = None) -> NDArray[np.float64]:
        scale = np.full(len(self._sum) if n_lines is None else n_lines, 2.0)
        scale[0] = 1.0
        if self.settings.segment_length % 2 == 0:
            scale[-1] = 1.0
        return scale / (self.sample_rate * float(self._window @ self._window) * self.n_segments)

    def _spectra(self, mean: NDArray[np.complex128]) -> CrossSpectra:
        n = len(self.excitations)
        lines = np.fft.rfftfreq(self.settings.segment_length, 1 / self.sample_rate)
        frequencies = np.asarray(lines, dtype=np.float64)
        take_out_delays(mean, frequencies, (*self.excitations, *self.responses))
        return CrossSpectra(
            frequencies=frequencies,
            input_spectra=mean[:, :n, :n],
            cross_spectra=mean[:, n:, :n],
            output_spectra=mean[:, n:, n:],
            excitations=self.excitations,
            responses=self.responses,
            n_segments=self.n_segments,
            effective_averages=effective_averages(self.settings, self.n_segments),
            settings=self.settings,
            sample_rate=self.sample_rate,
            n_excluded=self.n_excluded,
        )


def take_out_delays(
    spectra: NDArray[np.complex128], frequencies: NDArray[np.float64], channels: Sequence[Channel]
) -> None:
    """Turn the phases of spectra (n_lines, n, n), in place, to those of channels without their input delays.

    ``S_uv exp(2 pi i f (tau_u - tau_v))``: being late by tau turns a channel's lines by ``exp(-2 pi i f tau)``.
    """
    delays = np.array([channel.input_delay_s or 0.0 for channel in channels])
    if np.ptp(delays) == 0:
        return
    turned = np.exp(2j * np.pi * frequencies[:, None] * (delays - delays.min()))
    for row in range(len(channels)):  # row by row: no second array of this size
        spectra[:, row, :] *= turned[:, row, None] * turned.conj()


def _transformed(segments: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Transform of one channel's segments, in this thread.

    scipy's own threads are not asked (``workers``): they end before each fork of the process, and where that meets
    their beginning, the fork waits for ever.
    """
    return np.asarray(scipy.fft.rfft(segments, axis=1, overwrite_x=True))


def _detrended(segments: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """A copy with mean or least-squares line taken off the last axis."""
    if kind == "none":
        return segments.copy()
    centred: NDArray[np.float64] = segments - segments.mean(axis=-1, keepdims=True)
    if kind == "constant":
        return centred
    ramp = np.arange(segments.shape[-1]) - (segments.shape[-1] - 1) / 2
    centred -= ((centred @ ramp) / float(ramp @ ramp))[..., None] * ramp
    return centred


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


LONGEST = 8.0
"""Longest segment, s: longer ones leave too few averages, and inputs that depend on each other would not show."""

LEAST = 8
"""Fewest samples in a segment."""


def spectra_for_judging(recordings: Sequence[BandRecording]) -> tuple[CrossSpectra, ...]:
    """Average Welch spectra of each recording, in segments so long that each input can have a segment of its own.

    Parameters
    ----------
    recordings
        Recordings of one set-up, at least one.
    """
    n_inputs = len(recordings[0].excitations)
    shortest = min(one.duration for one in recordings)
    seconds = min(LONGEST, shortest, shortest * len(recordings) / (2 * n_inputs))
    return tuple(_averaged(one, max(seconds, LEAST / one.rate)) for one in recordings)


def _averaged(recording: BandRecording, seconds: float) -> CrossSpectra:
    """Spectra in segments of some seconds."""
    settings = settings_for(recording.rate, seconds, window="hann")
    accumulator = SpectralAccumulator(recording.excitations, recording.responses, recording.rate, settings)
    accumulator.add(recording.force, recording.response)
    return accumulator.finish()
