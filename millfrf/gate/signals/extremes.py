"""Clipping without a known full scale: samples that pile up on a channel's largest or smallest value."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

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
