"""Channels that are copies of one another: a cable in two inputs, or a column written twice."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
