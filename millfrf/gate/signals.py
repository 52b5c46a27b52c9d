"""Levels and faults of the channels of a recording, in one pass over its samples."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Stream
from estimation import rounding_step
from millfrf.core.progress import progress
from millfrf.core.terminal import Table

from .settings import GATE
from .signal_faults import Copies, Extreme, RepeatedRows, is_coarse


@dataclass
class ChannelLevel:
    """Running level of one channel, updated block by block."""

    channel: Channel
    n_samples: int = 0
    total: float = 0.0
    squares: float = 0.0
    lowest: float = np.inf
    highest: float = -np.inf
    n_missing: int = 0
    n_overloaded: int = 0
    _origin: float | None = None
    longest_held: int = 0
    _held: int = 0
    _last: float | None = None
    _step: float | None = None  # step of the first block's values; 0: none is visible
    _top: Extreme = field(default_factory=Extreme)
    _bottom: Extreme = field(default_factory=Extreme)

    def add(self, samples: np.ndarray) -> None:
        """Add the next samples of the channel; count samples that are not finite, and leave them out."""
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
        if self._step is None:
            self._step = rounding_step(finite)
        self._hold(finite)
        self._top.add(finite)
        self._bottom.add(-finite)
        if self.channel.full_scale:
            self.n_overloaded += int(np.sum(np.abs(finite) >= GATE.overload * self.channel.full_scale))

    def _hold(self, samples: np.ndarray) -> None:
        """Update the length of the longest run of equal samples, also across blocks."""
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
        """Number of clipped samples at the largest or smallest value, and this value; None if no sample is clipped.

        A channel with few different values (a commanded step, a switch) is not clipped.
        """
        piled = [end for end in (self._top, self._bottom) if end.piled(self.peak)]
        count = sum(end.count for end in piled)
        if not piled or self._top.count + self._bottom.count > GATE.two_levels * self.n_samples:
            return None
        return count, self._top.value if piled[0] is self._top else -self._bottom.value

    def warnings(self) -> list[str]:
        """List the faults of this channel."""
        name, texts = self.channel.name, []
        if self.n_missing:
            texts.append(f"{name}: {self.n_missing} samples are NaN or infinite; record anew or cut them out")
        if self.n_overloaded:
            texts.append(f"{name}: {self.n_overloaded} samples at full scale (overload); choose a larger range")
        clipped = self.clipped
        if clipped and not self.n_overloaded:
            texts.append(
                f"{name}: {clipped[0]} samples pile up at {clipped[1]:.4g} {self.channel.unit} (clipped, though no "
                "full scale is known); choose a larger range, or leave these segments out with --exclude"
            )
        if self.n_samples and self.deviation == 0:
            texts.append(f"{name}: every sample is {self.mean:g} (dead channel); check cable and supply")
        elif self.longest_held > max(GATE.constant_samples, GATE.constant_share * self.n_samples):
            texts.append(
                f"{name}: {self.longest_held} samples in a row have the same value: check the cable, and cut that part "
                "out"
            )
        if is_coarse(self._step or 0.0, self.deviation):
            rounding = (self._step or 0.0) / np.sqrt(12)
            texts.append(
                f"{name}: steps of {self._step:.3g} {self.channel.unit} are coarse: rounding is noise of "
                f"{100 * rounding / self.deviation:.0f} % of the signal; choose a smaller range, or store more digits"
            )
        full_scale = self.channel.full_scale
        if full_scale and self.n_samples and 0 < self.peak < 1e-3 * full_scale:
            texts.append(f"{name}: peak is {100 * self.peak / full_scale:.2g} % of full scale; choose a smaller range")
        return texts


def level_table(stream: Stream, levels: tuple[ChannelLevel, ...]) -> Table:
    """Make a table of the levels of a stream's channels, one row per channel."""
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


@dataclass(frozen=True)
class SignalCheck:
    """Levels and faults of a stream; ``levels`` has one entry per channel."""

    levels: tuple[ChannelLevel, ...]
    repeats: RepeatedRows
    copies: Copies

    def warnings(self, sample_rate: float) -> list[str]:
        """List the faults, one sentence each with its remedy."""
        texts = [text for level in self.levels for text in level.warnings()]
        # rows of NaN repeat each other: the missing samples are reported already
        if not any(level.n_missing for level in self.levels):
            texts += self.repeats.warnings(sample_rate)
        texts += [
            f"{copy} holds the same samples as {first}; check the cables and the mapping, one of them is not measured"
            for first, copy in self.copies.equal_pairs()
        ]
        texts += sample_rate_warnings(sample_rate)
        return texts + [
            f"{copy} is {first} times a fixed number in every sample; check the cables and the mapping"
            for first, copy in self.copies.proportional_pairs()
        ]


def sample_rate_warnings(sample_rate: float) -> list[str]:
    """Return a warning if a sample rate (Hz) is too low for vibration."""
    if sample_rate >= GATE.sample_rate_min:
        return []
    return [
        f"sampled at {sample_rate:.4g} Hz, too slowly for vibration: were times in ms taken as s (time_unit of the "
        "mapping), or a rate in kHz as Hz?"
    ]


def check_signals(stream: Stream, names: Sequence[str] | None = None) -> SignalCheck:
    """Read a stream once, and return the levels and faults of its channels.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of the channels to check; None: all.
    """
    known = {channel.name: channel for channel in stream.channels}
    chosen = tuple(known) if names is None else tuple(names)
    levels = tuple(ChannelLevel(known[name]) for name in chosen)
    repeats, copies = RepeatedRows(), Copies(chosen)
    done = 0
    with progress(f"levels of {stream.name}", stream.n_samples) as update:
        for block in stream.blocks(channels=chosen):
            _add_block(block, levels, repeats, copies)
            done += len(block)
            update(done)
    return SignalCheck(levels, repeats, copies)


def _add_block(
    block: NDArray[np.float64], levels: Sequence[ChannelLevel], repeats: RepeatedRows, copies: Copies
) -> None:
    with np.errstate(over="ignore", invalid="ignore"):  # absurd samples are refused by their peak
        for column, level in enumerate(levels):
            level.add(block[:, column])
        repeats.add(block)
        copies.add(block[np.isfinite(block).all(axis=1)])
