"""A part of a recording: its samples between two times, with the events and clock pairs of that part."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..sources import StreamDescription
from .content import Content, Samples


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
