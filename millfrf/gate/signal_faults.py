"""Faults of signals: copied channels, clipping, repeated rows."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real

EXACT = 1e-12
"""One minus the correlation of two channels below which one is the other times a factor: two sensors differ by more."""


@dataclass
class Copies:
    """Pairs of channels that are equal or proportional in all samples so far.

    Parameters
    ----------
    names
        Names of the channels, along the columns.
    same, proportional
        Pairs of column numbers that are still equal (or opposite), or in a fixed ratio; None before the first block.
    """

    names: tuple[str, ...]
    same: set[tuple[int, int]] | None = None
    proportional: set[tuple[int, int]] = field(default_factory=set)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take in the next rows (n, n_channels), all finite."""
        if len(rows) < 2:
            return
        centred = rows - rows.mean(axis=0)
        size = np.sqrt(np.sum(centred**2, axis=0))
        safe = np.where(size > 0, size, 1.0)
        near = 1 - np.abs((centred / safe).T @ (centred / safe)) < EXACT
        moving = size > 0
        pairs = {
            (int(a), int(b)) for a, b in np.argwhere(np.triu(near & moving[:, None] & moving[None, :], 1)).tolist()
        }
        equal = {(a, b) for a, b in pairs if (rows[:, a] == rows[:, b]).all() or (rows[:, a] == -rows[:, b]).all()}
        if self.same is None:
            self.same, self.proportional = equal, pairs
        else:
            self.same &= equal
            self.proportional &= pairs

    def equal_pairs(self) -> list[tuple[str, str]]:
        """Names of channels that hold the same samples, or the same with the other sign."""
        return [(self.names[a], self.names[b]) for a, b in sorted(self.same or set())]

    def proportional_pairs(self) -> list[tuple[str, str]]:
        """Names of channels that are one another times a factor, without those that are equal."""
        return [(self.names[a], self.names[b]) for a, b in sorted(self.proportional - (self.same or set()))]


LEAST_VISITS = 3
"""Times that the signal comes to the value and leaves it again: a signal that rests at one end is not clipped."""

LEAST_PILED = 8
"""Samples at the value, all visits together."""

PILED = 5.0
"""Samples at the value over samples at the next one: 2.4 for a sine that is stored in few steps, 1 for noise."""

NEAR_ZERO = 1e-3
"""Share of the peak within which an extreme counts as zero: a tooth out of the cut gives exactly none."""


@dataclass
class Extreme:
    """Samples at the largest value of one channel, and at the next one, counted as blocks come in.

    Parameters
    ----------
    value, following
        Largest value so far and the next one beneath it.
    count, n_following
        Samples at each.
    visits
        Runs of samples at ``value``.
    longest
        Samples of the longest of them.
    """

    value: float = -np.inf
    following: float = -np.inf
    count: int = 0
    n_following: int = 0
    visits: int = 0
    longest: int = 0

    def add(self, samples: Real) -> None:
        """Take in the next samples (n,), all finite, at least one."""
        high = np.sort(samples[samples >= self.following])[::-1]
        if not len(high):
            return
        if high[0] > self.value:
            self._raise_to(float(high[0]), high)
        self.count += int(np.sum(high == self.value))
        rest = high[high < self.value]
        if len(rest) and rest[0] > self.following:
            self.following, self.n_following = float(rest[0]), 0
        self.n_following += int(np.sum(rest == self.following))
        lengths = run_lengths(samples == self.value)
        self.visits += len(lengths)
        self.longest = max(self.longest, int(lengths.max(initial=0)))

    def _raise_to(self, value: float, high: Real) -> None:
        """A larger value came: the old largest may now be the next one."""
        between = high[high < value]
        if not len(between) or between[0] <= self.value:
            self.following, self.n_following = self.value, self.count
        self.value, self.count, self.visits, self.longest = value, 0, 0, 0

    def piled(self, peak: float) -> bool:
        """Say whether samples pile up here as only a limit makes them; ``peak`` is the channel's largest magnitude."""
        if self.visits < LEAST_VISITS or self.count < LEAST_PILED or self.longest < 2:
            return False
        return self.count > PILED * max(self.n_following, 1) and abs(self.value) > NEAR_ZERO * peak


def run_lengths(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Lengths of the runs of True, in order.

    Examples
    --------
    >>> run_lengths(np.array([True, True, False, True])).tolist()
    [2, 1]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return np.asarray(edges[1::2] - edges[::2], dtype=np.int64)


HELD = 8
"""Equal rows in a row, in every channel, that noise does not make."""

REPEATED = 16
"""Rows in a row that equal earlier rows at one distance, in every channel."""

PERIODIC = 0.2
"""Share of repeated rows above which a record is a noise-free periodic simulation and not a faulty one."""


def _none_yet() -> NDArray[np.uint64]:
    return np.empty(0, dtype=np.uint64)


@dataclass
class RepeatedRows:
    """Counts of rows that repeat others, as blocks come in; the block before is remembered.

    Parameters
    ----------
    n_rows
        Rows so far.
    n_held
        Rows in stretches of at least eight that are equal to the row before in every channel.
    n_repeated
        Rows in stretches of at least sixteen that equal earlier rows (one block or less before) at one distance.
    """

    n_rows: int = 0
    n_held: int = 0
    n_repeated: int = 0
    _before: NDArray[np.uint64] = field(default_factory=_none_yet)

    def add(self, rows: NDArray[np.float64]) -> None:
        """Take in the next rows (n, n_channels)."""
        if rows.shape[1] == 0 or not len(rows):
            return
        marks = np.concatenate([self._before, _marks(rows)])
        fresh = len(self._before)
        same = np.concatenate([[False], marks[1:] == marks[:-1]])
        held = _in_long_runs(same, HELD - 1)
        lag = np.where(same, 0, _distances(marks))
        steady = np.concatenate([[False], (lag[1:] == lag[:-1]) & (lag[1:] > 0)])
        again = _in_long_runs(steady, REPEATED - 1)
        self.n_rows += len(rows)
        self.n_held += int(held[fresh:].sum())
        self.n_repeated += int(again[fresh:].sum())
        self._before = marks[fresh:]

    def concerns(self, sample_rate: float) -> list[str]:
        """List the faults, one sentence each."""
        found = []
        if 0 < self.n_held < self.n_rows:
            found.append(
                f"all channels hold their last value for {self.n_held / sample_rate:.3g} s in sum ({self.n_held} "
                "samples): buffers were lost; leave these segments out with --exclude, or record anew"
            )
        if 0 < self.n_repeated < PERIODIC * self.n_rows:
            found.append(
                f"{self.n_repeated} samples of all channels ({self.n_repeated / sample_rate:.3g} s) repeat earlier "
                "ones: a buffer was stored twice; cut the second copy out, or record anew"
            )
        return found


def _marks(rows: NDArray[np.float64]) -> NDArray[np.uint64]:
    """One number a row that is equal for equal rows: bits times odd constants, summed modulo 2^64."""
    bits = np.ascontiguousarray(rows, dtype=np.float64).view(np.uint64)
    odd = np.random.default_rng(1).integers(1, 1 << 63, rows.shape[1], dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    mixed = bits ^ (bits >> np.uint64(29))
    return np.asarray((mixed * odd).sum(axis=1, dtype=np.uint64))


def _distances(marks: NDArray[np.uint64]) -> NDArray[np.int64]:
    """How many rows before each row the last equal one stands; 0 where there is none."""
    order = np.argsort(marks, kind="stable")
    twice = marks[order[1:]] == marks[order[:-1]]
    found = np.zeros(len(marks), dtype=np.int64)
    found[order[1:][twice]] = (order[1:] - order[:-1])[twice]
    return found


def _in_long_runs(flags: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """True inside runs of at least ``shortest`` True."""
    starts = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8)])) == 1)
    found = np.zeros(len(flags), dtype=bool)
    for start, length in zip(starts, run_lengths(flags), strict=True):
        if length >= shortest:
            found[start : start + length] = True
    return found
