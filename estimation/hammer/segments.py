"""Begin and end of a tap's segment, and which taps have room for one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from foundation import InputError

from .screening import FoundTaps, JudgedTap

LONGEST = 16.0
"""Segments are not made longer by themselves, s: noise grows with them, and structures have died out."""

LOST = 0.2
"""Share of a test's taps that longer segments may cost."""

QUIET = 4
"""Least samples before a contact from which the resting level of a channel can be told."""

_RISE = 0.75  # of a contact lies before its peak, at most
ENOUGH = 0.6
"""Share of that longer segment from which a shorter one will do, for which no tap is lost."""

_FILTER = 24  # samples that a converter's filter rings before and after a hard contact
_SHORTEST = 64  # samples in a segment


@dataclass(frozen=True)
class TapSettings:
    """How taps are cut out and windowed.

    Parameters
    ----------
    sample_rate
        Hz, of all tests.
    length
        Samples in a segment, an even number.
    before
        Samples from the segment's beginning to the tap's peak.
    force_samples
        Samples from the segment's beginning until the force window falls; None: no force window.
    time_constant
        tau of the exponential window ``exp(-t/tau)``, s; None: no such window.
    """

    sample_rate: float
    length: int
    before: int
    force_samples: int | None
    time_constant: float | None = None

    @property
    def duration(self) -> float:
        """Duration of a segment, s."""
        return self.length / self.sample_rate


def choose_segments(
    found: Sequence[FoundTaps],
    *,
    segment: float | None = None,
    pre_trigger: float | None = None,
    force_window: float | None = None,
) -> TapSettings:
    """Choose segments for the taps of all tests, as long as the time between taps allows.

    Parameters
    ----------
    found
        Taps of each test; at least one of them is usable.
    segment : s
        Duration of a segment; None: the time between taps, up to 16 s; where a few follow one another much sooner, they
        are lost.
    pre_trigger : s
        Time before a tap's peak; None: twice the longest contact, 24 samples at least, or what there is.
    force_window : s
        Time from the peak after which the force is cut off; 0: never; None: twice the longest contact, 24 samples at
        least.

    Raises
    ------
    InputError
        No usable tap, sample rates that differ, times that cannot be, or taps that leave no room for a segment.
    """
    rates = sorted({each.sample_rate for each in found})
    if len(rates) != 1:
        raise InputError(f"recordings of {rates[0]:g} and {rates[-1]:g} Hz; give recordings of one sample rate")
    for name, value in (("segment", segment), ("pre-trigger", pre_trigger)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} of {value:g} s must be positive; leave it out to have it chosen")
    if not any(each.used for each in found):
        raise InputError("no tap can be used; tap again")
    rate = rates[0]
    contact = max(one.tap.contact for each in found for one in each.used)
    natural, least = max(round(2 * contact * rate), _FILTER), round(_RISE * contact * rate) + QUIET
    earliest = min(one.place for each in found for one in each.used)
    before = max(least, min(natural, earliest)) if pre_trigger is None else round(pre_trigger * rate)
    if before < least:
        raise InputError(
            f"a pre-trigger of {1e3 * before / rate:.3g} ms cuts into the contacts, which last up to "
            f"{1e3 * contact:.3g} ms; give {2 * contact:.3g} s"
        )
    after = natural if force_window is None else round(force_window * rate)
    if 0 < after < contact * rate:
        raise InputError(
            f"a force window of {1e3 * after / rate:.3g} ms cuts into the contacts, which last up to "
            f"{1e3 * contact:.3g} ms; give {2 * contact:.3g} s"
        )
    length = _room(found, before) if segment is None else round(segment * rate)
    length -= length % 2
    if length < max(_SHORTEST, 2 * before):
        raise InputError(
            f"segments of {length / rate:.3g} s hold no answer beside contacts of {1e3 * contact:.3g} ms; tap more "
            "slowly, or give longer segments"
        )
    return TapSettings(rate, length, before, before + after if after else None)


def _room(found: Sequence[FoundTaps], before: int) -> int:
    """Samples that a segment may have."""
    rooms = []
    for each in found:
        gaps = sorted(_gap(each, number, before) for number, one in enumerate(each.taps) if not one.reason)
        if gaps:
            most = gaps[int(LOST * len(gaps))]
            rooms.append(gaps[0] if gaps[0] >= ENOUGH * most else most)
    return min(*rooms, round(LONGEST * found[0].sample_rate))


def _gap(found: FoundTaps, number: int, before: int) -> int:
    """Samples from a tap's beginning to the beginning of whatever hit follows, or to the record's end."""
    later = found.taps[number + 1 :]
    return later[0].place - found.taps[number].place if later else found.n_samples - found.taps[number].place + before


def placed(found: FoundTaps, settings: TapSettings) -> FoundTaps:
    """The same taps; those without room for a segment are left out."""
    return replace(
        found,
        taps=tuple(
            one if one.reason else replace(one, reason=_without_room(found, number, settings))
            for number, one in enumerate(found.taps)
        ),
    )


def _without_room(found: FoundTaps, number: int, settings: TapSettings) -> str:
    one, rate = found.taps[number], settings.sample_rate
    if one.place < settings.before:
        return (
            f"too early: {1e3 * one.place / rate:.3g} ms after the recording begins, the pre-trigger is "
            f"{1e3 * settings.before / rate:.3g} ms"
        )
    gap = _gap(found, number, settings.before)
    if gap >= settings.length:
        return ""
    if number + 1 < len(found.taps):
        return f"the next hit follows after {gap / rate:.3g} s, within the segment of {settings.duration:.4g} s"
    return f"the recording ends {gap / rate:.3g} s later, within the segment of {settings.duration:.4g} s"


def rise(one: JudgedTap, sample_rate: float) -> int:
    """Samples before a tap's peak in which it may already be in contact."""
    return round(_RISE * one.tap.contact * sample_rate)
