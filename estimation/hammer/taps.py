"""Find the taps of a hammer, and their double hits, in force signals."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Real = NDArray[np.float64]
SETTLE = 0.2
"""Shortest time between two taps, s."""

_TAP = 0.2  # of the largest force in the record: a tap
_AGAIN = 0.05  # of a tap's peak: contact
_SECOND = 0.1  # of a tap's peak: a second hit
_ABOVE_NOISE = 12.0  # standard deviations of the noise: white noise stays below 6 in any record
_RINGING = 8  # samples for which a converter's filter may ring after a hard contact
_LEVEL = 1.0  # s, over which the resting level is a median


@dataclass(frozen=True)
class Tap:
    """One tap of the hammer.

    Parameters
    ----------
    time : s
        Time of its peak from the record's start.
    peak : N
        Largest force, with its sign.
    contact : s
        Duration of the first contact.
    second_hit : s, or None
        Delay of a second contact. Such a tap must be left out: its force has holes in the spectrum.
    second_share
        Peak of the second contact over the first; 0 without one.
    channel
        Column of the force channel that was hit hardest.
    """

    time: float
    peak: float
    contact: float
    second_hit: float | None
    second_share: float
    channel: int = 0


def find_taps(force: Real, sample_rate: float, *, settle: float = SETTLE, least: float = _TAP) -> tuple[Tap, ...]:
    """Find taps and their double hits in one or several force signals.

    A tap is where the force passes ``least`` times its largest magnitude, and twelve standard deviations of the noise,
    after ``settle`` seconds without. Contacts are stretches above a twentieth of the tap's peak; a second one within
    ``settle``, of the same sign, that reaches a tenth of the peak is a double hit.

    Parameters
    ----------
    force : (n_samples,) or (n_samples, n_channels), N
        Signal of one hammer, or of several force channels.
    sample_rate : Hz
        Samples a second.
    settle : s
        Shortest time between taps.
    least
        Force from which a hit counts as a tap, as a share of the largest force.

    Returns
    -------
    tuple of Tap
        In order of time; empty where nothing stands out of the noise.

    Raises
    ------
    InputError
        A force that is neither one signal nor a table of signals, or without any signal.

    Examples
    --------
    >>> force = np.zeros(1000)
    >>> force[100:105] = [20, 80, 100, 80, 20]
    >>> force[130:133] = [10, 20, 10]
    >>> [tap] = find_taps(force, 10_000.0)
    >>> tap.peak, round(tap.second_hit, 4), tap.second_share
    (100.0, 0.0029, 0.2)
    """
    signals = np.asarray(force, dtype=float)
    if signals.ndim not in (1, 2):
        raise InputError(f"force of shape {signals.shape}: give one channel, or samples by channels")
    signals = at_rest(signals.reshape(len(signals), -1), sample_rate)
    size = np.abs(signals)
    if not size.any():
        raise InputError("the force signal is constant; check the hammer's channel")
    gap = max(1, round(settle * sample_rate))
    floor = np.maximum(least * size.max(), _ABOVE_NOISE * noise_of(signals))
    above = np.flatnonzero((size > floor).any(axis=1))
    if not len(above):
        return ()
    first = above[np.concatenate([[True], np.diff(above) > gap])]
    return tuple(_tap(signals, size, int(start), gap, sample_rate) for start in first)


def at_rest(signals: Real, sample_rate: float) -> Real:
    """Signals (n_samples, n_channels) without their resting level: medians over seconds, joined by straight lines."""
    blocks = max(1, int(len(signals) / (_LEVEL * sample_rate)))
    edges = np.linspace(0, len(signals), blocks + 1).astype(int)
    centres = (edges[1:] + edges[:-1]) / 2
    levels = np.array([np.median(signals[a:b], axis=0) for a, b in itertools.pairwise(edges)])
    places = np.arange(len(signals))
    return np.asarray(signals - np.column_stack([np.interp(places, centres, column) for column in levels.T]))


def noise_of(signals: Real) -> Real:
    """Standard deviation of the noise of each channel, from the median: taps are too short to count, (n_channels,)."""
    return np.asarray(1.4826 * np.median(np.abs(signals), axis=0))


def _tap(signals: Real, size: Real, start: int, gap: int, sample_rate: float) -> Tap:
    low = max(0, start - gap // 4)
    channel = int(np.argmax(size[low : start + gap].max(axis=0)))
    part = size[low : start + gap, channel]
    top = int(np.argmax(part))
    touching = np.concatenate([[False], part > _AGAIN * part[top], [False]])
    edges = np.flatnonzero(np.diff(touching.astype(int)))
    contacts = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    main = next((a, b) for a, b in contacts if a <= top < b)
    others = [(float(part[a:b].max()), a + int(np.argmax(part[a:b]))) for a, b in contacts if (a, b) != main]
    pushes = np.sign(signals[low : start + gap, channel]) == np.sign(signals[low + top, channel])
    others = [
        (peak, where)
        for peak, where in others
        if peak > _SECOND * part[top] and pushes[where] and abs(where - top) > _RINGING
    ]
    second = max(others, default=None)
    return Tap(
        (low + top) / sample_rate,
        float(signals[low + top, channel]),
        (main[1] - main[0]) / sample_rate,
        None if second is None else abs(second[1] - top) / sample_rate,
        0.0 if second is None else second[0] / float(part[top]),
        channel,
    )
