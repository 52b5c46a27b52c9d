"""Samples that can be trusted: overload, clipping and dropped buffers are found before spectra are averaged."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel

OVERLOAD = 0.999
"""Share of full scale from which a sample counts as overloaded."""

_LEAST_EQUAL = 4  # equal samples in a row at a channel's largest magnitude
_REPEATED = 8  # equal rows in a row: a buffer that was handed out twice, or not filled


def usable_samples(samples: NDArray[np.floating], channels: Sequence[Channel]) -> NDArray[np.bool_]:
    """Say which samples are usable: finite, not overloaded, not clipped and not repeated.

    Overload needs a channel's ``full_scale``. Clipping is also found without: at least four equal samples in a
    row at the block's extreme of a channel. Rows of which at least eight in a row are equal in every channel are a
    dropped buffer.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Samples in the unit of their channels.
    channels
        Channels along the columns.

    Returns
    -------
    (n_samples,), bool

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
        size = np.abs(np.where(np.isfinite(data[:, column]), data[:, column], 0.0))
        if channel.full_scale is not None:
            usable &= size < OVERLOAD * channel.full_scale
        for extreme in (np.nanmax(data[:, column], initial=-np.inf), np.nanmin(data[:, column], initial=np.inf)):
            if extreme != 0:
                usable &= ~_in_runs(data[:, column] == extreme, _LEAST_EQUAL)
    if len(data) > 1 and data.any():
        same = np.concatenate([[False], (np.diff(data, axis=0) == 0).all(axis=1)])
        usable &= ~_in_runs(same, _REPEATED - 1)
    return np.asarray(usable)


def _in_runs(flags: NDArray[np.bool_], shortest: int) -> NDArray[np.bool_]:
    """True inside runs of at least ``shortest`` True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    found = np.zeros(len(flags), dtype=bool)
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start >= shortest:
            found[start:stop] = True
    return found
