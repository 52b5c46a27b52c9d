"""Buffers that were lost: rows that hold the last value, and blocks of rows that come twice."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .extremes import run_lengths

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
