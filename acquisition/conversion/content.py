"""Content that a conversion carries from any file to any other, whole or between two times."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError

from ..recordings.recording import Recording
from ..sources.source import StreamDescription

Pairs = tuple[NDArray[np.float64], NDArray[np.float64]]


class Samples(Protocol):
    """Rows of one stream, read when asked for; an open recording's `Stream` is one."""

    @property
    def description(self) -> StreamDescription:
        """Name, rate and channels."""

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """float32 or float64."""

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Rows (n_samples, n_channels), SI units."""


@dataclass(frozen=True)
class ArraySamples:
    """Samples in memory, (n_samples, n_channels), SI units.

    Raises
    ------
    FileFormatError
        No samples, columns that do not match the channels, or values that are not finite.
    """

    description: StreamDescription
    array: NDArray[np.floating]

    def __post_init__(self) -> None:
        stream, width = self.description, len(self.description.channels)
        if self.array.ndim != 2 or self.array.shape[1] != width or not len(self.array):
            raise FileFormatError(
                f"stream {stream.name}: samples of shape {self.array.shape} do not fit {width} channels; expected "
                f"(n_samples, {width})"
            )
        finite = np.isfinite(self.array)
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise FileFormatError(
                f"channel {stream.channels[column].name} holds {self.array[row, column]} at sample {row}; "
                "cut or mend the data before converting"
            )

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return len(self.array)

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """float32 or float64."""
        return self.array.dtype

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Rows ``start`` to ``stop`` as float64."""
        return np.asarray(self.array[start:stop], dtype=float)


@dataclass(frozen=True)
class Content:
    """The content of a recording, wherever it is stored.

    Parameters
    ----------
    streams
        Samples, one entry a sample clock.
    title, setup, recorded_at
        Title, set-up and date, as in a recording; ``recorded_at`` is empty where it is not known.
    events
        Times (s) and values by name.
    event_texts
        The text of each value by name, for series that have texts.
    clock_pairs
        (sample index, host time) by stream, (n_pairs, 2).
    provenance
        Where it comes from, as JSON text.
    """

    streams: tuple[Samples, ...]
    title: str = ""
    setup: str = ""
    recorded_at: str = ""
    events: Mapping[str, Pairs] = field(default_factory=dict)
    clock_pairs: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    event_texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    provenance: str = ""


def recording_content(recording: Recording) -> Content:
    """Content of an open recording; its samples stay in the file."""
    events = recording.events
    return Content(
        tuple(recording.streams.values()),
        recording.title,
        recording.setup,
        recording.recorded_at,
        {name: series.read() for name, series in events.items()},
        {name: recording.clock_pairs(name) for name in recording.streams},
        {name: series.read_texts() for name, series in events.items() if series.axis.texts},
    )


def row_blocks(samples: Samples, block_length: int = 1 << 15) -> Iterator[NDArray[np.float64]]:
    """All rows in order, at most ``block_length`` at a time."""
    for start in range(0, samples.n_samples, block_length):
        yield samples.read(start, min(start + block_length, samples.n_samples))


@dataclass(frozen=True)
class _Rows:
    """Rows ``first`` to before ``last`` of other samples; they stay where they are until they are read."""

    whole: Samples
    first: int
    last: int

    @property
    def description(self) -> StreamDescription:
        """Name, rate and channels; the start is that of the part."""
        whole = self.whole.description
        return replace(whole, start_time=whole.start_time + self.first / whole.sample_rate)

    @property
    def n_samples(self) -> int:
        """Number of samples of each channel."""
        return self.last - self.first

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """float32 or float64."""
        return self.whole.dtype

    def read(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """Rows ``start`` to ``stop`` of the part, SI units."""
        end = self.last if stop is None else min(self.first + stop, self.last)
        return self.whole.read(self.first + start, end)


def part_of(content: Content, span: tuple[float, float]) -> Content:
    """Keep what lies between two times; times stay on the recording's axis.

    Parameters
    ----------
    content
        Content of a recording.
    span : s
        First and last time, counted from the first sample of each stream.

    Raises
    ------
    InputError
        Times that do not rise, or a part without samples.
    """
    low, high = span
    if not 0 <= low < high:
        raise InputError(f"span {low:g} to {high:g} s is empty; give two rising times from 0 on")
    streams = tuple(_rows(samples, low, high) for samples in content.streams)
    start = min(samples.description.start_time for samples in content.streams)
    kept = {name: (times >= start + low) & (times < start + high) for name, (times, _) in content.events.items()}
    events = {name: (times[kept[name]], values[kept[name]]) for name, (times, values) in content.events.items()}
    texts = {
        name: tuple(text for text, inside in zip(told, kept[name], strict=True) if inside)
        for name, told in content.event_texts.items()
    }
    return replace(content, streams=streams, events=events, event_texts=texts, clock_pairs=_pairs(content, streams))


def _rows(samples: Samples, low: float, high: float) -> _Rows:
    rate = samples.description.sample_rate
    first, last = (min(round(time * rate), samples.n_samples) for time in (low, high))
    if last - first < 1:
        raise InputError(
            f"stream {samples.description.name} lasts {samples.n_samples / rate:.6g} s; "
            f"nothing lies in {low:g} to {high:g} s"
        )
    return _Rows(samples, first, last)


def _pairs(content: Content, streams: tuple[_Rows, ...]) -> Mapping[str, NDArray[np.float64]]:
    """Sample counts of the part with their host times."""
    found = {}
    for rows in streams:
        name = rows.description.name
        pairs = np.asarray(content.clock_pairs.get(name, np.empty((0, 2))), dtype=float).reshape(-1, 2)
        inside = pairs[(pairs[:, 0] >= rows.first) & (pairs[:, 0] <= rows.last)]
        found[name] = inside - np.array([rows.first, 0.0])
    return found
