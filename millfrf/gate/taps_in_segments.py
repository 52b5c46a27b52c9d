"""Taps of a hammer in recordings whose spectra are averaged over segments that know nothing of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition import Stream
from estimation import find_taps
from millfrf.core import InputError

from .signals import ChannelLevel

IMPULSIVE = 12.0
"""Peak over standard deviation above which a force is taken for taps of a hammer; a cut has less than 6."""

LONGEST = 900.0
"""Seconds beyond which a recording is no hammer test."""

SUSPECT = 5.0
"""Peak over standard deviation from which a force is looked at: one tap in a short record has little more."""

STANDS_OUT = 12.0
"""Peak over the force's middle magnitude from which pulses stand in quiet: a cut has below 5."""

DUTY = 0.1
"""Share of the time in contact, at most; teeth of a light cut have about as much."""

MANY = 10.0
"""Taps a segment from which they are a random force, as segments and windows are made for."""

EARLY = 0.25
"""Share of a segment within which a tap must lie if the segment is to hold its answer."""


@dataclass(frozen=True)
class Segmentation:
    """Segments into which a job cuts a recording.

    Parameters
    ----------
    seconds : s
        Duration of a segment.
    overlap
        Share that a segment has in common with the next.
    window
        Name of the window.
    """

    seconds: float
    overlap: float
    window: str


def refuse_taps(stream: Stream, levels: Sequence[ChannelLevel], cut: Segmentation) -> None:
    """Refuse a recording of hammer taps whose force and answer the segments would weigh differently.

    A window is large in its middle, wherever the tap is: it can make the answer many times larger than the force, with
    a coherence of one. Segments without window and overlap hold where each begins just before a tap.

    Raises
    ------
    InputError
        With the number of taps and the command that is made for them.
    """
    if stream.duration > LONGEST:
        return
    for level in levels:
        if level.channel.quantity != "force" or level.n_missing or level.peak < SUSPECT * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        if not _tapped(force, stream.sample_rate, cut.seconds):
            continue
        times = np.array([tap.time for tap in find_taps(force, stream.sample_rate)])
        if cut.window == "boxcar" and cut.overlap == 0 and _early(times, stream.duration, cut.seconds):
            continue
        raise InputError(
            f"{stream.path.name}: the force on {level.channel.name} comes in {len(times)} "
            f"tap{'s' if len(times) != 1 else ''} of a hammer; segments of {cut.seconds:g} s {_harm(cut)}: use "
            "'millfrf tap', which cuts at the taps"
        )


def _harm(cut: Segmentation) -> str:
    if cut.window == "boxcar":
        return "begin anywhere between them, so that answers are cut off and counted without their tap"
    return f"under a {cut.window} window weigh a tap and its answer differently: the FRF would be wrong many times over"


def _tapped(force: NDArray[np.float64], sample_rate: float, seconds: float) -> bool:
    """Say whether a force is a few pulses in quiet."""
    size = np.abs(force - np.median(force))
    if size.max() <= STANDS_OUT * 1.4826 * np.median(size):
        return False
    pushed = size > 0.2 * size.max()
    pulses = int(np.sum(np.diff(pushed.astype(np.int8)) > 0)) + int(pushed[0])
    a_segment = pulses * min(1.0, seconds * sample_rate / len(force))
    return bool(pushed.mean() < DUTY and a_segment < MANY)


def _early(times: NDArray[np.float64], duration: float, seconds: float) -> bool:
    """Say whether each tap that lies in a whole segment lies at its beginning."""
    whole = times[times < np.floor(duration / seconds) * seconds]
    return bool(((whole % seconds) < EARLY * seconds).all())
