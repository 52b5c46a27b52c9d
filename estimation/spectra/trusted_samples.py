"""Overload, clipping and dropped buffers in sampled signals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import Real

from ..settings import RECORDINGS


def runs_of_true(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first index, and the index after the last, of each run of True in flags (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(start), int(stop)) for start, stop in zip(edges[::2], edges[1::2], strict=True)]


def usable_samples(samples: NDArray[np.floating], channels: Sequence[Channel]) -> NDArray[np.bool_]:
    """Find the samples (n_samples,) that are finite, not overloaded, not clipped and not repeated.

    Overload is found by a channel's ``full_scale``; clipping as equal samples in succession at the largest or smallest
    value of a channel in the block. Rows in succession that are equal in every channel are a dropped buffer.

    Examples
    --------
    >>> wave = np.clip(np.sin(np.arange(100) / 10), -1, 0.9)[:, None]
    >>> bad = ~usable_samples(wave, [Channel("a", "force", "N", "TCP", "+X")])
    >>> bool(bad.any()), bool((wave[bad] == 0.9).all())
    (True, True)
    """
    data = np.asarray(samples, dtype=float)
    usable = np.isfinite(data).all(axis=1)
    for column, channel in enumerate(channels):
        magnitude = np.abs(np.where(np.isfinite(data[:, column]), data[:, column], 0.0))
        if channel.full_scale is not None:
            usable &= magnitude < RECORDINGS.overload * channel.full_scale
        for extreme in (np.nanmax(data[:, column], initial=-np.inf), np.nanmin(data[:, column], initial=np.inf)):
            if extreme != 0:  # a channel that rests at zero is not clipped
                usable &= ~_in_long_runs(data[:, column] == extreme, RECORDINGS.clipped_samples)
    if len(data) > 1 and data.any():  # channels that all rest at zero are no dropped buffer
        same = np.concatenate([[False], (np.diff(data, axis=0) == 0).all(axis=1)])
        usable &= ~_in_long_runs(same, RECORDINGS.repeated_rows - 1)
    return np.asarray(usable)


def _in_long_runs(flags: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    inside = np.zeros(len(flags), dtype=bool)
    for start, stop in runs_of_true(flags):
        inside[start:stop] = stop - start >= shortest
    return inside


def is_clipped(samples: Real, full_scale: float | None) -> bool:
    """Return whether a signal (n,) reaches its full scale, or stays at its extreme as only a limit can make it stay.

    Examples
    --------
    >>> wave = 100 * np.sin(np.arange(200) / 15)
    >>> is_clipped(wave, None), is_clipped(np.clip(wave, -80, 80), None), is_clipped(wave, 100.0)
    (False, True, True)
    """
    if not len(samples):
        return False
    if full_scale is not None and np.abs(samples).max() >= RECORDINGS.overload * full_scale:
        return True
    steps = np.abs(np.diff(samples))
    steps = steps[steps > 0]
    if not len(steps):
        return False
    return any(_is_flat(samples, extreme, float(steps.min())) for extreme in (samples.max(), samples.min()))


def _is_flat(samples: Real, extreme: float, smallest_step: float) -> bool:
    """Return whether samples stay at the extreme and leave it abruptly, unlike the small steps at a smooth maximum."""
    if extreme == 0:
        return False
    for start, stop in runs_of_true(samples == extreme):
        edges = [abs(samples[k] - extreme) for k in (start - 1, stop) if 0 <= k < len(samples)]
        if stop - start >= RECORDINGS.flat_samples and edges and max(edges) > RECORDINGS.steep_edge * smallest_step:
            return True
    return False
