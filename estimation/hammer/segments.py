"""Segments of taps: their limits, the samples within, and their force and exponential windows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from acquisition import Stream, opened
from millfrf.core import Complex, Index, InputError, Real

from ..settings import HAMMER
from ..spectra.trusted_samples import is_clipped
from .taps import FoundTaps, JudgedTap


@dataclass(frozen=True)
class TapSettings:
    """Settings by which taps are cut out and windowed."""

    sample_rate: float  # Hz, of all tests
    length: int  # samples in a segment, an even number
    before: int  # samples from the segment's beginning to the tap's peak
    # samples from the segment's beginning until the force window falls; None: no force window
    force_samples: int | None
    # s; time constant tau of the exponential window ``exp(-t/tau)``; None: no such window
    time_constant: float | None = None

    @property
    def duration(self) -> float:
        """Return the duration of a segment, s."""
        return self.length / self.sample_rate


def choose_segments(
    tests: Sequence[FoundTaps],
    *,
    segment: float | None = None,
    pre_trigger: float | None = None,
    force_window: float | None = None,
) -> TapSettings:
    """Choose segments for the taps of all tests, as long as the time between taps allows.

    Parameters
    ----------
    tests
        Taps of each test; at least one of them is usable.
    segment : s
        Duration of a segment; None: the time between taps, up to 16 s; a few taps that follow much sooner are left out.
    pre_trigger : s
        Time before a tap's peak; None: twice the longest contact, 24 samples at least, or all the time there is. Zeros
        precede a recording that begins with its tap.
    force_window : s
        Time from the peak after which the force is cut off; 0: never; None: twice the longest contact, 24 samples at
        least.

    Raises
    ------
    InputError
        No usable tap, sample rates that differ, durations that are not possible, or taps too close for a segment.
    """
    rates = sorted({test.sample_rate for test in tests})
    if len(rates) != 1:
        raise InputError(f"recordings of {rates[0]:g} and {rates[-1]:g} Hz; give recordings of one sample rate")
    for name, value in (("segment", segment), ("pre-trigger", pre_trigger)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} of {value:g} s must be positive; leave it out to have it chosen")
    used = [each for test in tests for each in test.used]
    if not used:
        raise InputError("no tap can be used; tap again")
    rate = rates[0]
    contact = max(each.tap.contact for each in used)
    natural = max(round(2 * contact * rate), HAMMER.filter_samples)
    least = round(HAMMER.rise * contact * rate) + HAMMER.level_samples
    earliest = min(each.place for each in used)
    # twice the contact, but no longer than the time before the first tap, so that this tap is not lost
    before = max(least, min(natural, earliest)) if pre_trigger is None else round(pre_trigger * rate)
    after = natural if force_window is None else round(force_window * rate)
    too_short = (("pre-trigger", before, before < least), ("force window", after, 0 < after < contact * rate))
    for name, count, wrong in too_short:
        if wrong:
            raise InputError(
                f"a {name} of {1e3 * count / rate:.3g} ms cuts into the contacts, which last up to "
                f"{1e3 * contact:.3g} ms; give {2 * contact:.3g} s"
            )
    length = _longest_segment(tests, before) if segment is None else round(segment * rate)
    length -= length % 2
    if length < max(HAMMER.shortest_segment, 2 * before):
        raise InputError(
            f"segments of {length / rate:.3g} s hold no response after contacts of {1e3 * contact:.3g} ms; tap more "
            f"slowly, give longer segments, or correct the sample rate of {rate:.4g} Hz if it is wrong"
        )
    return TapSettings(rate, length, before, before + after if after else None)


def _longest_segment(tests: Sequence[FoundTaps], before: int) -> int:
    """Return the largest number of samples of a segment with which few taps are lost."""
    lengths = []
    for test in tests:
        # the longest time that only few taps do not have; the shortest of all where it is nearly as long
        gaps = sorted(_gap(test, number, before) for number, tap in enumerate(test.taps) if not tap.reason)
        if gaps:
            longest = gaps[int(HAMMER.lost_taps * len(gaps))]
            lengths.append(gaps[0] if gaps[0] >= HAMMER.enough_length * longest else longest)
    return min(*lengths, round(HAMMER.longest_segment * tests[0].sample_rate))


def _gap(taps: FoundTaps, number: int, before: int) -> int:
    """Count the samples from a tap's beginning to the beginning of the next hit of any kind, or to the record's end."""
    place, later = taps.taps[number].place, taps.taps[number + 1 :]
    return later[0].place - place if later else taps.n_samples - place + before


def segments_of(taps: FoundTaps, settings: TapSettings, before: int = 0) -> Iterator[tuple[int, Real]]:
    """Yield the number and the samples of each usable tap of a test, without resting levels and steady tones.

    The samples (before + length, n_excitations + n_responses) begin ``before`` samples before the segment, with zeros
    where the recording has none.
    """
    with opened(taps.test.path) as recording:
        stream = recording.stream(taps.test.stream)
        for number, tap in enumerate(taps.taps):
            if not tap.reason:
                start = tap.place - settings.before
                first, stop = max(0, start - before), start + settings.length
                samples = _read(stream, taps, first, stop)
                samples = samples - _resting_level(stream, taps, number, settings, np.arange(first, stop))
                yield number, np.concatenate([np.zeros((before - (start - first), samples.shape[1])), samples])


def _read(stream: Stream, taps: FoundTaps, first: int, stop: int) -> Real:
    """Read samples of a test's channels without its steady tones."""
    samples = stream.read(first, stop, taps.test.names)
    for tone in taps.tones:
        samples = samples - tone.at(np.arange(first, stop), taps.sample_rate)
    return samples


def screened(taps: FoundTaps, settings: TapSettings) -> FoundTaps:
    """Leave out taps without room for a segment, and taps whose segment is overloaded, incomplete or hit again.

    Parameters
    ----------
    taps
        Taps of one test.
    settings
        Lengths and windows of the segments.
    """
    with opened(taps.test.path) as recording:
        stream = recording.stream(taps.test.stream)
        judged = tuple(
            tap if tap.reason else replace(tap, reason=_reason(stream, taps, number, settings))
            for number, tap in enumerate(taps.taps)
        )
    return replace(taps, taps=judged)


def _reason(stream: Stream, taps: FoundTaps, number: int, settings: TapSettings) -> str:
    """Return the reason to leave a tap out because of its segment; empty for none."""
    tap, rate = taps.taps[number], settings.sample_rate
    if tap.place < settings.before and _begins_in_contact(stream, taps, tap):
        return f"too early: the recording begins within the contact, {1e3 * tap.place / rate:.3g} ms before its peak"
    gap = _gap(taps, number, settings.before)
    if gap < settings.length:
        within = f"within the segment of {settings.duration:.4g} s"
        if number + 1 < len(taps.taps):
            return f"the next hit follows after {gap / rate:.3g} s, {within}"
        return f"the recording ends {gap / rate:.3g} s later, {within}"
    channels, start = (*taps.test.excitations, *taps.test.responses), tap.place - settings.before
    samples = stream.read(max(0, start), start + settings.length, taps.test.names)
    for column, channel in enumerate(channels):
        if not np.isfinite(samples[:, column]).all():
            return f"missing samples: {channel.name} is not finite"
        if is_clipped(samples[:, column], channel.full_scale):
            side = "force" if column < len(taps.test.excitations) else "response"
            return f"overload: the {side} on {channel.name} is clipped"
    column = tap.tap.channel
    force = samples[:, column] - _level_before(stream, taps, number, settings)[1][column]
    return _echo(tap, np.concatenate([np.zeros(max(0, -start)), force]), float(taps.noise[column]), settings)


def begins_with_recording(tap: JudgedTap, settings: TapSettings) -> bool:
    """Return whether a tap has no time before its contact: zeros stand for it, and the level is that of its end.

    Recordings that a trigger starts, or that were cut at it, begin so.
    """
    return tap.place < settings.before and not tap.reason


def _begins_in_contact(stream: Stream, taps: FoundTaps, tap: JudgedTap) -> bool:
    """Return whether the first sample of a recording already shows the force of a tap."""
    force = stream.read(0, 1, taps.test.names)[0, tap.tap.channel]
    return bool(np.sign(tap.tap.peak) * force > HAMMER.contact * abs(tap.tap.peak))


def _echo(tap: JudgedTap, force: Real, noise: float, settings: TapSettings) -> str:
    """Return a reason where the force returns with its sign after the force window has begun to fall; else empty."""
    start = settings.force_samples
    if start is None or start >= len(force):
        return ""
    after = np.sign(tap.tap.peak) * force[start:]
    if after.max() <= max(HAMMER.echo * abs(tap.tap.peak), HAMMER.echo_noise * noise):
        return ""
    delay = (start + int(np.argmax(after)) - settings.before) / settings.sample_rate
    return f"double hit: {100 * after.max() / abs(tap.tap.peak):.1f} % once more after {1e3 * delay:.1f} ms"


def _resting_level(stream: Stream, taps: FoundTaps, number: int, settings: TapSettings, samples: Index) -> Real:
    """Return the resting level (n_samples, n_channels): a straight line from before this tap to before the next hit.

    After the last hit the line continues; a single tap has a constant level.
    """
    centre, level = _level_before(stream, taps, number, settings)
    if len(taps.taps) == 1:
        return np.broadcast_to(level, (len(samples), len(level)))
    other = number + 1 if number + 1 < len(taps.taps) else number - 1
    other_centre, other_level = _level_before(stream, taps, other, settings)
    return np.asarray(level + np.multiply.outer((samples - centre) / (other_centre - centre), other_level - level))


def _level_before(stream: Stream, taps: FoundTaps, number: int, settings: TapSettings) -> tuple[float, Real]:
    """Return the middle (sample) of the quiet time before a hit, and the mean of each channel in it.

    If the hit begins its recording, the time before the next hit counts instead.

    The mean is taken under a Hann window, which hardly passes the ringing of the structure.
    """
    tap = taps.taps[number]
    last = tap.place - _rise(tap, settings)
    first = max(0, tap.place - max(settings.before, round(HAMMER.level_share * settings.length)))
    if number:
        earlier = taps.taps[number - 1]
        first = max(first, min(earlier.place + 2 * _rise(earlier, settings), last - settings.before))
    if begins_with_recording(tap, settings):
        # without time before the contact: the second half of the time until the next hit
        end = taps.taps[number + 1].place - settings.before if number + 1 < len(taps.taps) else taps.n_samples
        first, last = (tap.place + end) // 2, end
    samples = _read(stream, taps, max(0, first), max(last, 1))
    weight = scipy.signal.windows.hann(len(samples) + 2)[1:-1]
    return (first + last - 1) / 2, np.asarray(weight @ samples / weight.sum())


def _rise(tap: JudgedTap, settings: TapSettings) -> int:
    """Return the number of samples before a tap's peak in which the hammer may already be in contact."""
    return round(HAMMER.rise * tap.tap.contact * settings.sample_rate)


def force_window(n_samples: int, sample_rate: float, duration: float) -> Real:
    """Compute the force window (n_samples,): 1 up to ``duration`` (s), a cosine fall over a quarter of it, then 0."""
    time = np.arange(n_samples) / sample_rate
    fall = np.clip((time - duration) / (0.25 * duration), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * fall)))


def exponential_window(n_samples: int, sample_rate: float, time_constant: float) -> Real:
    """Compute ``exp(-t / tau)``, (n_samples,), for a response that has not died out at the segment's end.

    Apply it to force and response alike. The transform of ``h(t) exp(-t / tau)`` is ``H(i w + 1/tau)``: the FRF is
    exact, but at another place of the Laplace plane, where every pole seems to lie ``1/tau`` further to the left. The
    values cannot be corrected line by line to ``i w``: that would undo the window, and bring back the truncation that
    it prevents. An FRF therefore carries the time constant (``exponential_time_constant``), and a fit subtracts
    ``1/tau`` from the damping of the poles.

    Raises
    ------
    InputError
        A time constant that is not positive.
    """
    if not time_constant > 0:
        raise InputError(f"time constant {time_constant:g} s must be positive; leave it out for no window")
    return np.asarray(np.exp(-np.arange(n_samples) / (sample_rate * time_constant)))


def window_correlation(apart: Real, time_constant: float) -> Complex:
    """Return the correlation that the window gives to white noise on two lines, ``1 / (1 + i pi apart tau)``.

    It is the transform of ``exp(-2 t / tau)`` over its value at 0 Hz, for segments of several tau. The variance of each
    line does not depend on it, but a fit that takes lines as independent gives error bars that are too small, because
    the window leaves the noise where the response is, at the segment's beginning. A pole with damping ``sigma``
    (rad/s), fitted on lines ``df`` apart, has ``2 / (tau df) ((sigma + a) / (sigma + 2 a))^3`` times the variance that
    independent lines would give, with a = 1/tau.

    Parameters
    ----------
    apart : Hz
        Distances of lines, of any shape.
    time_constant : s
        Time constant tau of the window.

    Examples
    --------
    >>> bool(abs(window_correlation(np.array([2.0]), 0.1))[0] > 0.8)
    True
    """
    return np.asarray(1 / (1 + 1j * np.pi * np.asarray(apart) * time_constant))
