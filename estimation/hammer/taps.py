"""Taps of a hammer: detected in force signals, and judged (double hits, overload, weak taps)."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition import Channel, opened
from millfrf.core import Complex, Index, InputError, Real

from ..band_recordings.resampling import require_room
from ..settings import HAMMER, RECORDINGS
from ..spectra.trusted_samples import is_clipped, runs_of_true


@dataclass(frozen=True)
class Tap:
    """One tap of the hammer."""

    time: float  # s, of its peak from the record's start
    peak: float  # N, largest force with its sign
    contact: float  # s, duration of the first contact
    second_hit: float | None  # s, delay of a second contact; the force of such a tap has gaps in its spectrum
    second_share: float  # peak of the second contact over the first; 0 without one
    channel: int = 0  # column of the force channel that was hit hardest


def find_taps(
    force: Real, sample_rate: float, *, settle: float = HAMMER.settle, least: float = HAMMER.tap
) -> tuple[Tap, ...]:
    """Find taps and their double hits in one or several force signals.

    A tap is where the force exceeds ``least`` times its largest magnitude, and twelve standard deviations of the noise,
    after ``settle`` seconds below this limit. Contacts are stretches above a twentieth of the tap's peak; a second one
    within ``settle``, of the same sign, that reaches a tenth of the peak is a double hit.

    Parameters
    ----------
    force : (n_samples,) or (n_samples, n_channels), N
        Signal of one hammer, or of several force channels.
    sample_rate : Hz
        Samples per second.
    settle : s
        Shortest time between taps.
    least
        Force from which a hit counts as a tap, as a share of the largest force.

    Returns
    -------
    tuple of Tap
        In order of time; empty where nothing exceeds the noise.

    Raises
    ------
    InputError
        A force that is neither one signal nor a table of signals, or a constant force.

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
    signals = _without_level(signals.reshape(len(signals), -1), sample_rate)
    magnitude = np.abs(signals)
    if not magnitude.any():
        raise InputError("the force signal is constant; check the hammer's channel")
    gap = max(1, round(settle * sample_rate))
    threshold = np.maximum(least * magnitude.max(), HAMMER.noise_level * _noise_of(signals))
    above = np.flatnonzero((magnitude > threshold).any(axis=1))
    starts = above[np.diff(above, prepend=-gap - 1) > gap]
    return tuple(_tap(signals, int(start), gap, sample_rate) for start in starts)


def _without_level(signals: Real, sample_rate: float) -> Real:
    """Subtract the resting level from signals (n_samples, n_channels).

    The level is the median of each second, joined by straight lines.
    """
    n_blocks = max(1, int(len(signals) / (HAMMER.level_seconds * sample_rate)))
    edges = np.linspace(0, len(signals), n_blocks + 1).astype(int)
    centres = (edges[1:] + edges[:-1]) / 2
    levels = np.array([np.median(signals[a:b], axis=0) for a, b in itertools.pairwise(edges)])
    samples = np.arange(len(signals))
    return np.asarray(signals - np.column_stack([np.interp(samples, centres, column) for column in levels.T]))


def _noise_of(signals: Real) -> Real:
    """Estimate the standard deviation (n_channels,) of the noise from the median, which short taps hardly change."""
    return np.asarray(1.4826 * np.median(np.abs(signals), axis=0))


def _tap(signals: Real, start: int, gap: int, sample_rate: float) -> Tap:
    low = max(0, start - gap // 4)  # the threshold is crossed after the contact has begun
    channel = int(np.argmax(np.abs(signals[low : start + gap]).max(axis=0)))
    force = signals[low : start + gap, channel]
    magnitude = np.abs(force)
    top = int(np.argmax(magnitude))
    peak = magnitude[top]
    contacts = runs_of_true(magnitude > HAMMER.contact * peak)
    first, last = next((a, b) for a, b in contacts if a <= top < b)
    others = [(float(magnitude[a:b].max()), a + int(np.argmax(magnitude[a:b]))) for a, b in contacts if a != first]
    hits = [
        (other, where)
        for other, where in others
        if other > HAMMER.second_hit * peak
        and np.sign(force[where]) == np.sign(force[top])
        and abs(where - top) > HAMMER.ringing_samples
    ]
    second = max(hits, default=None)
    return Tap(
        (low + top) / sample_rate,
        float(force[top]),
        (last - first) / sample_rate,
        None if second is None else abs(second[1] - top) / sample_rate,
        0.0 if second is None else second[0] / float(peak),
        channel,
    )


@dataclass(frozen=True)
class TapTest:
    """A recording of taps, with the channels and the time span that a job uses."""

    path: Path
    # channels by the names they have in the file, at the places where they were in this test
    excitations: tuple[Channel, ...]
    responses: tuple[Channel, ...]
    stream: str | None = None  # name of the sample clock; None: the only one
    span: tuple[float, float] = (-np.inf, np.inf)  # s; times on the recording's axis between which taps count

    @property
    def names(self) -> list[str]:
        """Return the names of the channels to read, forces first."""
        return [channel.name for channel in (*self.excitations, *self.responses)]


@dataclass(frozen=True)
class JudgedTap:
    """A tap, with the reason where it is left out."""

    tap: Tap
    place: int  # sample of its peak
    reason: str = ""  # empty: the tap is used


@dataclass(frozen=True)
class SteadyTone:
    """A tone that a test contains from its beginning to its end, ``Re(a exp(2 pi i f t))``, t from the first sample."""

    frequency: float  # f, Hz
    # (n_channels,); a of the test's channels, forces first, in their units; 0 where a channel does not contain it
    amplitudes: Complex

    def at(self, samples: Index, sample_rate: float) -> Real:
        """Compute the tone at samples of the recording, (n_samples, n_channels)."""
        turns = np.exp(2j * np.pi * self.frequency / sample_rate * samples)
        return np.asarray(np.multiply.outer(turns, self.amplitudes).real)


@dataclass(frozen=True)
class FoundTaps:
    """The taps found in one test."""

    test: TapTest
    sample_rate: float  # Hz
    n_samples: int
    start_time: float  # s, of the recording's first sample
    noise: Real  # (n_excitations,), N; standard deviation of each force between the taps
    taps: tuple[JudgedTap, ...]  # in order of time
    # share of the time in which a force exceeds a fifth of the largest: taps are short, cuts and shakers are not
    busy: float = 0.0
    tones: tuple[SteadyTone, ...] = ()  # mains hum, which is subtracted from the segments

    @property
    def used(self) -> tuple[JudgedTap, ...]:
        """Return the taps that are not left out."""
        return tuple(tap for tap in self.taps if not tap.reason)

    def time(self, tap: JudgedTap) -> float:
        """Return the time of a tap on the recording's axis, s."""
        return self.start_time + tap.tap.time


def require_room_for_taps(test: TapTest) -> None:
    """Refuse a recording for whose forces :func:`found_taps` has not enough memory, before a sample is read."""
    with opened(test.path) as recording:
        require_room(recording.stream(test.stream), len(test.excitations), RECORDINGS.bytes_per_tap_value)


def found_taps(test: TapTest) -> FoundTaps:
    """Find the taps of a test and judge them by their force.

    Raises
    ------
    InputError
        A missing channel, or a force that is constant.
    """
    require_room_for_taps(test)
    with opened(test.path) as recording:
        stream = recording.stream(test.stream)
        force = stream.read(channels=[channel.name for channel in test.excitations])
        rate, start = stream.sample_rate, stream.start_time
    centred = _without_level(force, rate)
    magnitude = np.abs(centred).max(axis=1)
    taps = []
    for tap in find_taps(force, rate, least=HAMMER.candidate):
        place = round(tap.time * rate)
        if test.span[0] <= start + tap.time <= test.span[1]:
            reason = _reason(tap, place, force, rate, test.excitations[tap.channel])
        else:
            reason = "outside the times given for this point"
        taps.append(JudgedTap(tap, place, reason))
    busy = float(np.mean(magnitude > HAMMER.busy * magnitude.max()))
    return FoundTaps(test, rate, len(force), start, _noise_of(centred), _without_weak(taps), busy)


def _reason(tap: Tap, place: int, force: Real, sample_rate: float, channel: Channel) -> str:
    if tap.second_hit is not None:
        return f"double hit: {100 * tap.second_share:.0f} % once more after {1e3 * tap.second_hit:.1f} ms"
    reach = round(HAMMER.settle * sample_rate)
    if is_clipped(force[max(0, place - reach) : place + reach, tap.channel], channel.full_scale):
        return f"overload: the force on {channel.name} is clipped"
    return ""


def _without_weak(taps: Sequence[JudgedTap]) -> tuple[JudgedTap, ...]:
    """Leave out taps far below the median peak, which would count as much in an average as strong taps."""
    peaks = [abs(each.tap.peak) for each in taps if not each.reason]
    middle = float(np.median(peaks)) if peaks else 0.0
    limit = f"below {100 * HAMMER.weak:.0f} % of the others' {middle:.3g} N"
    return tuple(
        replace(each, reason=f"weak: {abs(each.tap.peak):.3g} N, {limit}")
        if not each.reason and abs(each.tap.peak) < HAMMER.weak * middle
        else each
        for each in taps
    )
