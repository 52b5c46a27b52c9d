"""Checks of hammer tests."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition import Stream
from estimation import Decay, FoundTaps, Frf, MergedTaps, TapSettings, TapTest, find_taps
from millfrf.core import InputError

from .recordings import IMPULSIVE, LONGEST
from .signals import ChannelLevel

if TYPE_CHECKING:
    pass

import re
from collections import Counter

from .frfs import check_frf
from .recordings import check_channels, doubts_of

CUT_OFF = 0.02
"""Share of the answer at the segment's end above which it is said that it is cut off."""

STILL_RINGING = 0.01
"""Share of the answer to the tap before above which it is said that it still rings: an FRF is off by as much."""

DISAGREEING = 0.2
"""Energy of the difference between one test's entry and all tests' above which they are hardly the same point."""

COHERENT = 0.8
"""Median coherence in the band below which an entry is doubted."""

BUSY = 0.1
"""Share of the time in which the force exceeds a fifth of its largest value, above which it is no hammer's."""

NARROW = 0.5
"""Share of the widest band of a point hit, below which that of another point is said to be narrow."""


def check_tap_recordings(paths: Sequence[str | os.PathLike[str]], tests: Sequence[TapTest]) -> list[str]:
    """Judge the channels that hammer tests take from their recordings, as :func:`check_recordings` does.

    Samples that are clipped, missing or repeated are not told: taps that hold them are left out, each with its reason.
    ``tests`` are those of the recordings ``paths``, one or several each.
    """
    names = {
        str(test.path): ([one.name for one in test.excitations], [one.name for one in test.responses]) for test in tests
    }

    def chosen(source: Stream) -> tuple[list[str], list[str]]:
        return names[str(source.path)]

    return check_channels(paths, chosen, tests[0].stream, True)


def check_taps_found(found: Sequence[FoundTaps]) -> None:
    """Refuse a recording without a tap, or in which no tap can be used.

    Raises
    ------
    InputError
        With the file, and what was found in it: a cut, a shaker, noise, or taps that are all spoilt.
    """
    for each in found:
        channels = ", ".join(channel.name for channel in each.test.excitations)
        if not each.taps:
            raise InputError(
                f"{each.test.path.name}: no tap found: the force on {channels} nowhere stands out of its own noise by "
                "twelve standard deviations; check the hammer's channel, or leave the file out"
            )
        if each.busy > BUSY:
            raise InputError(
                f"{each.test.path.name}: no taps of a hammer: the force on {channels} exceeds a fifth of its "
                f"largest value during {100 * each.busy:.0f} % of the time, as in a cut or under a shaker; use "
                "'millfrf estimate'"
            )
    check_taps_used(found)


def check_taps_used(found: Sequence[FoundTaps]) -> None:
    """Refuse a recording in which no tap can be used.

    Raises
    ------
    InputError
        With the file and the reasons, the most frequent first.
    """
    for each in found:
        if not each.used:
            reasons = Counter(_kind(one.reason) for one in each.taps).most_common(3)
            first = next(one for one in each.taps if _kind(one.reason) == reasons[0][0])
            listed = ", ".join(f"{count} x {reason}" for reason, count in reasons)
            raise InputError(
                f"{each.test.path.name}: none of its {len(each.taps)} taps can be used ({listed}; the first at "
                f"{each.time(first):.3f} s, {first.reason}); {_remedy(reasons[0][0])}"
            )


def _kind(reason: str) -> str:
    """A reason without its figures."""
    return re.split(r":| after | \d", reason)[0]


def _remedy(reason: str) -> str:
    if reason.startswith(("the next hit", "the recording ends")):
        return "give a shorter --segment, or tap more slowly"
    if reason.startswith("too early"):
        return "give a shorter --pre-trigger, or record some time before the first tap"
    if reason.startswith("overload"):
        return "choose a larger range of that input and tap again"
    return "tap again, or leave the file out"


def doubts_of_taps(merged: MergedTaps, found: Sequence[FoundTaps], settings: TapSettings, decay: Decay) -> list[str]:
    """Give the doubts about an FRF of hammer tests, one sentence each."""
    return [
        *_of_averages(merged.frf),
        *_of_ringing(settings, decay),
        *_of_points(merged, found),
        *_of_disagreement(merged),
        *_of_coherence(merged.frf),
        *doubts_of(check_frf, merged.frf, "the FRF"),
    ]


def _of_averages(frf: Frf) -> list[str]:
    assert frf.averages is not None
    single = int((frf.averages < 2).sum())
    if not single:
        return []
    return [
        f"{single} of {frf.averages.size} entries rest on a single tap: no coherence can be had, and their noise can "
        "only be judged from neighbouring lines; tap each point three times or more"
    ]


def _of_ringing(settings: TapSettings, decay: Decay) -> list[str]:
    doubts = []
    tau = settings.time_constant
    left = decay.left * (1.0 if tau is None else np.exp(-settings.duration / tau))
    if left > CUT_OFF:
        doubts.append(
            f"{100 * left:.0f} % of the answer at {decay.frequency:.4g} Hz on {decay.response} is left when the "
            f"segment of {settings.duration:.4g} s ends, and is cut off: the FRF is off by as much there; leave "
            "--exponential auto, or give longer segments"
        )
    if decay.before > STILL_RINGING:
        doubts.append(
            f"{100 * decay.before:.0f} % of the answer to the tap before still rings when the next tap comes; wait "
            "longer between taps"
        )
    return doubts


def _of_points(merged: MergedTaps, found: Sequence[FoundTaps]) -> list[str]:
    doubts = []
    hit = {each.test.excitations[one.tap.channel].degree_of_freedom for each in found for one in each.used}
    idle = {channel.degree_of_freedom for each in found for channel in each.test.excitations} - hit
    if idle:
        doubts.append(f"no tap hit {', '.join(sorted(idle))}: the FRF has no column for it")
    lost = [label for label in (*merged.frf.excitations, *merged.frf.responses) if ":" not in label]
    if lost:
        doubts.append(
            f"nothing says where {', '.join(lost[:5])}{' ...' if len(lost) > 5 else ''} hit or measured: the FRF "
            "carries the channel's name; give --point or --points"
        )
    ends = {label: 0.0 if band is None else band[1] for label, band in merged.bands.items()}
    widest = max(ends, key=lambda label: ends[label])
    narrow = [label for label, end in ends.items() if end < NARROW * ends[widest]]
    if narrow:
        doubts.append(
            f"the force at {', '.join(narrow[:5])}{' ...' if len(narrow) > 5 else ''} drives up to "
            f"{ends[narrow[0]]:.4g} Hz only, that at {widest} up to {ends[widest]:.4g} Hz: the FRF's band ends with "
            "the lowest; hit every point with the same tip"
        )
    return doubts


def _of_disagreement(merged: MergedTaps) -> list[str]:
    worst = merged.disagreements[:1]
    if not worst or worst[0].share < DISAGREEING:
        return []
    one = worst[0]
    return [
        f"{one.test} sees {one.response} / {one.excitation} differently from the other files with that entry "
        f"({100 * np.sqrt(one.share):.0f} % off their average): was the same point hit, and did the sensor stand there?"
    ]


def _of_coherence(frf: Frf) -> list[str]:
    if frf.coherence is None:
        return []
    inside = frf.valid & (frf.frequencies > 0)
    if frf.band is not None:
        inside &= (frf.frequencies >= frf.band[0]) & (frf.frequencies <= frf.band[1])
    middle = np.nan_to_num(np.median(frf.coherence[inside], axis=0), nan=1.0)
    poor = np.argwhere(middle < COHERENT)
    if not len(poor):
        return []
    p, q = poor[int(np.argmin(middle[tuple(poor.T)]))]
    return [
        f"the coherence of {len(poor)} of {middle.size} entries is below {COHERENT:g} on half of the band's lines "
        f"(lowest: {frf.responses[p]} / {frf.excitations[q]}, median {middle[p, q]:.2f}); hit harder, or average more"
    ]


def tap_concerns(stream: Stream, levels: Sequence[ChannelLevel]) -> list[str]:
    """One sentence for each force channel with double hits."""
    found = []
    for level in levels:
        if level.channel.quantity != "force" or stream.duration > LONGEST or level.n_missing:
            continue
        if level.deviation == 0 or level.peak < IMPULSIVE * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        taps = find_taps(force, stream.sample_rate)
        double = [tap for tap in taps if tap.second_hit is not None]
        if double:
            times = ", ".join(f"{stream.start_time + tap.time:.3f} s" for tap in double[:5])
            found.append(
                f"{level.channel.name}: {len(double)} of {len(taps)} taps hit twice (at {times}; the first after "
                f"{1e3 * (double[0].second_hit or 0):.1f} ms with {100 * double[0].second_share:.0f} %); "
                "'millfrf tap' leaves them out"
            )
    return found
