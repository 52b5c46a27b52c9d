"""The last seconds of every channel as a band between minima and maxima: as many points as a screen shows."""

import math

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


class TraceBuffer:
    """Minimum and maximum of consecutive buckets of samples.

    Parameters
    ----------
    n_channels
        Number of columns of the samples.
    sample_rate : Hz
        Samples a second.
    window : s
        Duration that is kept.
    points
        Number of buckets in the window.
    """

    def __init__(self, n_channels: int, sample_rate: float, window: float = 5.0, points: int = 400) -> None:
        self._bucket = max(1, math.ceil(window * sample_rate / points))
        self._rate = sample_rate
        self._points = points
        self._lowest = np.zeros((0, n_channels))
        self._highest = np.zeros((0, n_channels))
        self._rest = np.zeros((0, n_channels))
        self._n_buckets = 0

    def add(self, samples: Real) -> None:
        """Take the next samples (n, n_channels)."""
        joined = np.concatenate([self._rest, samples]) if len(self._rest) else samples
        n_whole = len(joined) // self._bucket
        whole = joined[: n_whole * self._bucket].reshape(n_whole, self._bucket, samples.shape[1])
        self._rest = joined[n_whole * self._bucket :].copy()
        self._n_buckets += n_whole
        if n_whole:
            self._lowest = np.concatenate([self._lowest, whole.min(axis=1)])[-self._points :]
            self._highest = np.concatenate([self._highest, whole.max(axis=1)])[-self._points :]

    def drawn(self) -> tuple[Real, Real]:
        """Times (n,), s, and values (n, n_channels): minimum and maximum of each bucket in turn."""
        n = len(self._lowest)
        buckets = np.arange(self._n_buckets - n, self._n_buckets)
        times = (np.repeat(buckets, 2) + np.tile([0.25, 0.75], n)) * self._bucket / self._rate
        values = np.stack([self._lowest, self._highest], axis=1).reshape(2 * n, self._lowest.shape[1])
        return times, values
