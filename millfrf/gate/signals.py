"""Levels of the channels of a recording, in one pass over its samples."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Stream
from millfrf.core.progress import progress
from millfrf.core.terminal import Table

from .signal_faults import Copies, Extreme, RepeatedRows

NEAR_FULL_SCALE = 0.999
"""Samples above this share of full scale count as overloaded."""

TWO_LEVELS = 0.5
"""Share of samples at the two extremes above which a channel is a switch or a commanded step, not a clipped signal."""

LEAST_HELD, HELD_SHARE = 256, 0.05
"""Samples, and share of the record, that a live channel does not stand still for."""


@dataclass
class ChannelLevel:
    """Running level of one channel.

    Parameters
    ----------
    channel
        Channel whose samples these are.
    """

    channel: Channel
    n_samples: int = 0
    total: float = 0.0
    squares: float = 0.0
    lowest: float = field(default=np.inf)
    highest: float = field(default=-np.inf)
    n_missing: int = 0
    n_overloaded: int = 0
    _origin: float | None = None
    longest_held: int = 0
    _held: int = 0
    _last: float | None = None
    _top: Extreme = field(default_factory=Extreme)
    _bottom: Extreme = field(default_factory=Extreme)

    def add(self, samples: np.ndarray) -> None:
        """Take in the next samples (n,); those that are not finite are counted and left out."""
        finite = samples[np.isfinite(samples)]
        self.n_missing += len(samples) - len(finite)
        if not len(finite):
            return
        if self._origin is None:
            self._origin = float(finite[0])  # squares about a near value: no cancellation for a large offset
        centred = finite - self._origin
        self.n_samples += len(finite)
        self.total += float(centred.sum())
        self.squares += float(centred @ centred)
        self.lowest = min(self.lowest, float(finite.min()))
        self.highest = max(self.highest, float(finite.max()))
        self._hold(finite)
        self._top.add(finite)
        self._bottom.add(-finite)
        if self.channel.full_scale:
            self.n_overloaded += int(np.sum(np.abs(finite) >= NEAR_FULL_SCALE * self.channel.full_scale))

    def _hold(self, samples: np.ndarray) -> None:
        """Follow the longest run of one value, across blocks."""
        before = samples[:1] if self._last is None else np.array([self._last])
        changes = np.flatnonzero(np.diff(np.concatenate([before, samples])))
        ends = np.concatenate([changes, [len(samples)]])
        runs = np.diff(np.concatenate([[-self._held], ends]))
        self.longest_held = max(self.longest_held, int(runs.max()))
        self._held, self._last = int(runs[-1]), float(samples[-1])

    @property
    def mean(self) -> float:
        """Mean of all finite samples."""
        return (self._origin or 0.0) + self.total / max(self.n_samples, 1)

    @property
    def deviation(self) -> float:
        """Standard deviation: root mean square about the mean."""
        n = max(self.n_samples, 1)
        return float(np.sqrt(max(self.squares / n - (self.total / n) ** 2, 0.0)))

    @property
    def peak(self) -> float:
        """Largest magnitude so far."""
        return max(abs(self.lowest), abs(self.highest)) if self.n_samples else 0.0

    @property
    def clipped(self) -> tuple[int, float] | None:
        """Samples that pile up at the largest or smallest value, and that value; None where none do.

        A channel that takes few values only (a commanded step, a switch) is not clipped.
        """
        piled = [end for end in (self._top, self._bottom) if end.piled(self.peak)]
        count = sum(end.count for end in piled)
        if not piled or self._top.count + self._bottom.count > TWO_LEVELS * self.n_samples:
            return None
        return count, self._top.value if piled[0] is self._top else -self._bottom.value

    def concerns(self) -> list[str]:
        """List the faults of this channel."""
        name, found = self.channel.name, []
        if self.n_missing:
            found.append(f"{name}: {self.n_missing} samples are NaN or infinite; record anew or cut them out")
        if self.n_overloaded:
            found.append(f"{name}: {self.n_overloaded} samples at full scale (overload); choose a larger range")
        clipped = self.clipped
        if clipped and not self.n_overloaded:
            found.append(
                f"{name}: {clipped[0]} samples pile up at {clipped[1]:.4g} {self.channel.unit} (clipped, though no "
                "full scale is known); choose a larger range, or leave these segments out with --exclude"
            )
        if self.n_samples and self.deviation == 0:
            found.append(f"{name}: every sample is {self.mean:g} (dead channel); check cable and supply")
        elif self.longest_held > max(LEAST_HELD, HELD_SHARE * self.n_samples):
            found.append(
                f"{name}: {self.longest_held} samples in a row have the same value: check the cable, and cut that part "
                "out"
            )
        full_scale = self.channel.full_scale
        if full_scale and self.n_samples and 0 < self.peak < 1e-3 * full_scale:
            found.append(f"{name}: peak is {100 * self.peak / full_scale:.2g} % of full scale; choose a smaller range")
        return found


def level_table(stream: Stream, levels: tuple[ChannelLevel, ...]) -> Table:
    """One row a channel."""
    rows = tuple(
        (
            level.channel.name,
            level.channel.degree_of_freedom if level.channel.node else "",
            level.channel.quantity,
            level.channel.unit,
            f"{level.mean:.4g}",
            f"{level.deviation:.4g}",
            f"{level.peak:.4g}",
            "" if level.channel.full_scale is None else f"{level.channel.full_scale:g}",
            str(level.n_overloaded) if level.channel.full_scale else "",
        )
        for level in levels
    )
    columns = ("channel", "place", "quantity", "unit", "mean", "rms about mean", "peak", "full scale", "overloaded")
    title = f"stream {stream.name}: {stream.sample_rate:g} Hz, {stream.duration:.4g} s, {stream.n_samples} samples"
    return Table(title, columns, rows)


SLOWEST_RATE = 20.0
"""Hz: no vibration of a machine is recorded more slowly."""


@dataclass(frozen=True)
class Look:
    """Findings of one pass over a stream.

    Parameters
    ----------
    levels
        One a channel.
    repeats
        Rows that hold or repeat others.
    copies
        Channels that equal one another.
    """

    levels: tuple[ChannelLevel, ...]
    repeats: RepeatedRows
    copies: Copies

    def concerns(self, sample_rate: float) -> list[str]:
        """List the faults, one sentence each with its remedy."""
        found = [concern for level in self.levels for concern in level.concerns()]
        if not any(level.n_missing for level in self.levels):
            found += self.repeats.concerns(sample_rate)
        found += [
            f"{other} holds the same samples as {one}; check the cables and the mapping, one of them is not measured"
            for one, other in self.copies.equal_pairs()
        ]
        found += rate_concerns(sample_rate)
        return found + [
            f"{other} is {one} times a fixed number in every sample; check the cables and the mapping"
            for one, other in self.copies.proportional_pairs()
        ]


def rate_concerns(sample_rate: float) -> list[str]:
    """List the faults of a sample rate (Hz)."""
    if sample_rate >= SLOWEST_RATE:
        return []
    return [
        f"sampled at {sample_rate:.4g} Hz, too slowly for vibration: were times in ms taken as s (time_unit of the "
        "mapping), or a rate in kHz as Hz?"
    ]


def look(stream: Stream, names: Sequence[str] | None = None) -> Look:
    """Read a stream once and judge its channels.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of the channels to look at; None: all.
    """
    known = {channel.name: channel for channel in stream.channels}
    chosen = tuple(known) if names is None else tuple(names)
    levels = tuple(ChannelLevel(known[name]) for name in chosen)
    repeats, copies = RepeatedRows(), Copies(chosen)
    done = 0
    with progress(f"levels of {stream.name}", stream.n_samples) as update:
        for block in stream.blocks(channels=chosen):
            _take(block, levels, repeats, copies)
            done += len(block)
            update(done)
    return Look(levels, repeats, copies)


def _take(block: NDArray[np.float64], levels: Sequence[ChannelLevel], repeats: RepeatedRows, copies: Copies) -> None:
    with np.errstate(over="ignore", invalid="ignore"):  # absurd samples are refused by their peak
        for column, level in enumerate(levels):
            level.add(block[:, column])
        repeats.add(block)
        copies.add(block[np.isfinite(block).all(axis=1)])
