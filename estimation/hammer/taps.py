"""Taps of a hammer: detected in force signals, and judged (double hits, overload, weak taps)."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition import Channel, opened
from millfrf.core import InputError, Real

from ..band_recordings.resampling import require_room
from ..spectra.trusted_samples import OVERLOAD

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


CANDIDATE = 0.05
"""Share of a recording's largest force from which a hit is looked at."""

WEAK = 0.2
"""Share of the middle peak of a recording's taps below which a tap is left out as weak."""

_BYTES_A_VALUE = 140.0  # of the force, seen at the peak
_FLAT = 3  # samples in a row at the extreme value
_STEEP = 2.5  # times the smallest step: beside a smooth maximum the samples are one step away


@dataclass(frozen=True)
class TapTest:
    """A recording of taps, with the channels and the stretch of time that a job uses.

    Parameters
    ----------
    path
        Path of the recording.
    excitations, responses
        Channels by the names they have in the file, at the places where they were in this test.
    stream
        Name of the sample clock; None: the only one.
    span : s
        Times on the recording's axis between which taps count.
    """

    path: Path
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    stream: str | None = None
    span: tuple[float, float] = (-np.inf, np.inf)

    @property
    def names(self) -> list[str]:
        """Channels to read, forces first."""
        return [channel.name for channel in (*self.excitations, *self.responses)]


@dataclass(frozen=True)
class JudgedTap:
    """A tap, and why it is left out.

    Parameters
    ----------
    tap
        As found; its time counts from the first sample.
    place
        Sample of its peak.
    reason
        Why it is left out; empty: it is used.
    """

    tap: Tap
    place: int
    reason: str = ""


@dataclass(frozen=True)
class FoundTaps:
    """The taps found in one test.

    Parameters
    ----------
    test
        The test in which they were found.
    sample_rate : Hz
        Sample rate of the recording.
    n_samples
        Number of samples of the recording.
    start_time : s
        Time of the recording's first sample.
    noise : (n_excitations,), N
        Standard deviation of each force between the taps.
    taps
        The taps with their judgement, in order of time.
    busy
        Share of the time in which a force exceeds a fifth of the largest: taps are short, cuts and shakers are not.
    """

    test: TapTest
    sample_rate: float
    n_samples: int
    start_time: float
    noise: Real
    taps: tuple[JudgedTap, ...]
    busy: float = 0.0

    @property
    def used(self) -> tuple[JudgedTap, ...]:
        """The taps against which there is no reason."""
        return tuple(tap for tap in self.taps if not tap.reason)

    def time(self, tap: JudgedTap) -> float:
        """Give the time of a tap on the recording's axis, s."""
        return self.start_time + tap.tap.time


def require_room_for_taps(test: TapTest) -> None:
    """Refuse a recording whose forces :func:`found_taps` has no memory for, before a sample is read.

    Parameters
    ----------
    test
        The recording and its channels.

    Raises
    ------
    InputError
        It is too long; the line says how long it may be.
    """
    with opened(test.path) as recording:
        require_room(recording.stream(test.stream), len(test.excitations), _BYTES_A_VALUE)


def found_taps(test: TapTest) -> FoundTaps:
    """Find the taps of a test and judge them by their force.

    Raises
    ------
    InputError
        A channel that is not there, or a force that is constant.
    """
    require_room_for_taps(test)
    with opened(test.path) as recording:
        stream = recording.stream(test.stream)
        force = stream.read(channels=[channel.name for channel in test.excitations])
        rate, start = stream.sample_rate, stream.start_time
    quiet = at_rest(force, rate)
    size = np.abs(quiet).max(axis=1)
    judged = []
    for tap in find_taps(force, rate, least=CANDIDATE):
        one = JudgedTap(tap, round(tap.time * rate))
        if test.span[0] <= start + tap.time <= test.span[1]:
            judged.append(replace(one, reason=_reason(one, force, rate, test.excitations)))
        else:
            judged.append(replace(one, reason="outside the times given for this point"))
    busy = float(np.mean(size > 0.2 * size.max()))
    return FoundTaps(test, rate, len(force), start, noise_of(quiet), _without_weak(judged), busy)


def _reason(one: JudgedTap, force: Real, sample_rate: float, channels: Sequence[Channel]) -> str:
    tap = one.tap
    if tap.second_hit is not None:
        return f"double hit: {100 * tap.second_share:.0f} % once more after {1e3 * tap.second_hit:.1f} ms"
    reach = round(SETTLE * sample_rate)
    column = tap.channel
    if limited(force[max(0, one.place - reach) : one.place + reach, column], channels[column].full_scale):
        return f"overload: the force on {channels[column].name} is clipped"
    return ""


def limited(samples: Real, full_scale: float | None) -> bool:
    """Whether a signal (n,) reaches its full scale, or stands still at its extreme as only a limit makes it.

    Examples
    --------
    >>> wave = 100 * np.sin(np.arange(200) / 15)
    >>> limited(wave, None), limited(np.clip(wave, -80, 80), None), limited(wave, 100.0)
    (False, True, True)
    """
    if not len(samples):
        return False
    if full_scale is not None and np.abs(samples).max() >= OVERLOAD * full_scale:
        return True
    steps = np.abs(np.diff(samples))
    steps = steps[steps > 0]
    if not len(steps):
        return False
    return any(_flat(samples, extreme, float(steps.min())) for extreme in (samples.max(), samples.min()))


def _flat(samples: Real, extreme: float, step: float) -> bool:
    """Whether samples stand at the extreme, and are left by more than the smallest step there is."""
    if extreme == 0:
        return False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (samples == extreme).astype(np.int8), [0]])))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        beside = [abs(samples[k] - extreme) for k in (a - 1, b) if 0 <= k < len(samples)]
        if b - a >= _FLAT and beside and max(beside) > _STEEP * step:
            return True
    return False


def _without_weak(judged: Sequence[JudgedTap]) -> tuple[JudgedTap, ...]:
    """Taps far below the others, which count as an average as if they said as much, are left out."""
    peaks = [abs(one.tap.peak) for one in judged if not one.reason]
    if not peaks:
        return tuple(judged)
    middle = float(np.median(peaks))
    return tuple(
        replace(one, reason=f"weak: {abs(one.tap.peak):.3g} N, below {100 * WEAK:.0f} % of the others' {middle:.3g} N")
        if not one.reason and abs(one.tap.peak) < WEAK * middle
        else one
        for one in judged
    )
