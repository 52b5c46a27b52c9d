"""Content that a conversion transfers from any file to any other, as a whole or between two times."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Real

from ..recordings.recording import Recording
from ..sources.source import StreamDescription
from .sample_axis import Gap

Pairs = tuple[Real, Real]  # times (s) and values of a series of events


@dataclass(frozen=True)
class Samples:
    """Samples of one stream; ``read(start, stop)`` returns rows as float64, (n_samples, n_channels), in SI units.

    ``dtype`` is the type in which the samples are stored, float32 or float64.
    """

    description: StreamDescription
    n_samples: int
    dtype: "np.dtype[np.floating]"
    read: Callable[[int, int], Real]

    def blocks(self, block_length: int = 1 << 15) -> Iterator[Real]:
        """Read all rows in order, at most ``block_length`` at a time."""
        for start in range(0, self.n_samples, block_length):
            yield self.read(start, min(start + block_length, self.n_samples))


def samples_of_array(stream: StreamDescription, array: NDArray[np.floating], *, with_gaps: bool = False) -> Samples:
    """Make samples of an array (n_samples, n_channels); refuse a wrong shape or values that are not finite.

    With gaps, as recordings have them, rows of NaN are missing samples.
    """
    width = len(stream.channels)
    if array.ndim != 2 or array.shape[1] != width or not len(array):
        raise FileFormatError(
            f"stream {stream.name}: samples of shape {array.shape} do not fit {width} channels; expected "
            f"(n_samples, {width})"
        )
    _require_finite(stream, array, 0, with_gaps=with_gaps)
    return Samples(stream, len(array), array.dtype, lambda start, stop: np.asarray(array[start:stop], dtype=float))


def samples_on_request(
    stream: StreamDescription, n_samples: int, dtype: "np.dtype[np.floating]", read: Callable[[int, int], Real]
) -> Samples:
    """Make samples that ``read`` converts block by block; values that are not finite are refused when they are read."""

    def checked(start: int, stop: int) -> Real:
        rows = read(start, stop)
        _require_finite(stream, rows, start)
        return rows

    return Samples(stream, n_samples, dtype, checked)


def _require_finite(
    stream: StreamDescription, rows: NDArray[np.floating], start: int, *, with_gaps: bool = False
) -> None:
    finite = np.isfinite(rows)
    if with_gaps:
        finite |= np.isnan(rows).all(axis=1, keepdims=True)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise FileFormatError(
            f"channel {stream.channels[column].name} holds {rows[row, column]} at sample {start + row}; "
            "cut or correct the data before converting"
        )


def with_gaps(samples: Samples, gaps: Sequence[Gap]) -> Samples:
    """Insert rows of NaN where samples are missing, so that all others keep their time."""
    if not gaps:
        return samples
    lengths = np.zeros(samples.n_samples, dtype=int)
    for gap in gaps:
        lengths[gap.row] = gap.missing
    places = np.arange(samples.n_samples) + np.cumsum(lengths)

    def read(start: int, stop: int) -> Real:
        first, end = np.searchsorted(places, (start, stop))
        rows = np.full((stop - start, len(samples.description.channels)), np.nan)
        rows[places[first:end] - start] = samples.read(first, end)
        return rows

    return replace(samples, n_samples=int(places[-1]) + 1, read=read)


@dataclass(frozen=True)
class Content:
    """Content of a recording, independent of the file format.

    ``recorded_at`` is empty if it is not known. The keys of ``events`` and ``event_texts`` are the names of the series,
    the keys of ``clock_pairs`` the names of the streams; a pair is a sample index and a host time (s). ``provenance``
    is JSON text.
    """

    streams: tuple[Samples, ...]
    title: str = ""
    setup: str = ""
    recorded_at: str = ""
    events: Mapping[str, Pairs] = field(default_factory=dict)
    clock_pairs: Mapping[str, Real] = field(default_factory=dict)
    event_texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    provenance: str = ""


def recording_content(recording: Recording) -> Content:
    events = recording.events
    return Content(
        tuple(Samples(s.description, s.n_samples, s.dtype, s.read) for s in recording.streams.values()),
        recording.title,
        recording.setup,
        recording.recorded_at,
        {name: series.read() for name, series in events.items()},
        {name: recording.clock_pairs(name) for name in recording.streams},
        {name: series.read_texts() for name, series in events.items() if series.axis.texts},
    )


def between_times(content: Content, span: tuple[float, float]) -> Content:
    """Keep the content between two times (s) after the first sample of each stream; the time axis stays the same."""
    low, high = span
    if not 0 <= low < high:
        raise InputError(f"span {low:g} to {high:g} s is empty; give two rising times from 0 on")
    rows = [_rows_between(samples, low, high) for samples in content.streams]
    streams = tuple(_selected(samples, *span) for samples, span in zip(content.streams, rows, strict=True))
    start = min(samples.description.start_time for samples in content.streams)
    chosen = {name: (times >= start + low) & (times < start + high) for name, (times, _) in content.events.items()}
    events = {name: (times[chosen[name]], values[chosen[name]]) for name, (times, values) in content.events.items()}
    texts = {
        name: tuple(text for text, is_chosen in zip(all_texts, chosen[name], strict=True) if is_chosen)
        for name, all_texts in content.event_texts.items()
    }
    clock_pairs = {}
    for stream, (first, end) in zip(streams, rows, strict=True):
        name = stream.description.name
        pairs = np.asarray(content.clock_pairs.get(name, np.empty((0, 2))), dtype=float).reshape(-1, 2)
        within = (pairs[:, 0] >= first) & (pairs[:, 0] <= end)
        clock_pairs[name] = pairs[within] - np.array([first, 0.0])
    return replace(content, streams=streams, events=events, event_texts=texts, clock_pairs=clock_pairs)


def _rows_between(samples: Samples, low: float, high: float) -> tuple[int, int]:
    rate = samples.description.sample_rate
    first, end = (min(round(time * rate), samples.n_samples) for time in (low, high))
    if end - first < 1:
        raise InputError(
            f"stream {samples.description.name} lasts {samples.n_samples / rate:.6g} s; "
            f"nothing lies in {low:g} to {high:g} s"
        )
    return first, end


def _selected(samples: Samples, first: int, end: int) -> Samples:
    """Select the rows from ``first`` to before ``end``; they are still read on request."""
    stream = samples.description
    return replace(
        samples,
        description=replace(stream, start_time=stream.start_time + first / stream.sample_rate),
        n_samples=end - first,
        read=lambda start, stop: samples.read(first + start, min(first + stop, end)),
    )
