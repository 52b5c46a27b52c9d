"""One pass over a stream's samples: levels, repeated rows and copies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Stream

from ...progress import Progress, silent
from .channel_levels import ChannelLevel
from .copies import Copies
from .repeated_rows import RepeatedRows

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


def look(stream: Stream, names: Sequence[str] | None = None, progress: Progress = silent) -> Look:
    """Read a stream once and judge its channels.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of the channels to look at; None: all.
    progress
        Shows progress while samples are read.
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
