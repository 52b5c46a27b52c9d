"""Segments of taps: their limits, the samples within, and their force and exponential windows."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Stream, opened
from millfrf.core import InputError, Real

from .taps import FoundTaps, JudgedTap, limited

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


ECHO = 0.02
"""Share of the peak that the force may reach once more after the contact: what is cut off there is missing in H1."""

_ECHO_NOISE = 6.0  # standard deviations of the force's noise, which white noise hardly reaches
_QUIET = 0.25  # of a segment, before a tap, from which the resting level is told


def segments_of(found: FoundTaps, settings: TapSettings, before: int = 0) -> Iterator[tuple[int, Real]]:
    """Give the number and samples of each usable tap of a test, with the resting levels taken off.

    Parameters
    ----------
    found
        Taps of one test, each with room for a segment.
    settings
        Lengths with which the segments are cut.
    before
        Number of samples to give before the segment as well; 0 where the recording has none.

    Yields
    ------
    int, (before + length, n_excitations + n_responses)
    """
    names = found.test.names
    with opened(found.test.path) as recording:
        stream = recording.stream(found.test.stream)
        for number, one in enumerate(found.taps):
            if not one.reason:
                start = one.place - settings.before
                first = max(0, start - before)
                samples = stream.read(first, start + settings.length, names)
                samples = samples - _rest(stream, found, number, settings, np.arange(first, start + settings.length))
                yield number, np.concatenate([np.zeros((before - (start - first), samples.shape[1])), samples])


def screened(found: FoundTaps, settings: TapSettings) -> FoundTaps:
    """The same taps; those whose segment is overloaded, incomplete, or hit once more are left out."""
    names, n_forces = found.test.names, len(found.test.excitations)
    scales = [channel.full_scale for channel in (*found.test.excitations, *found.test.responses)]
    judged = list(found.taps)
    with opened(found.test.path) as recording:
        stream = recording.stream(found.test.stream)
        for number, one in enumerate(found.taps):
            if one.reason:
                continue
            start = one.place - settings.before
            samples = stream.read(start, start + settings.length, names)
            reason = _damage(samples, names, scales, n_forces)
            if not reason:
                force = samples[:, one.tap.channel] - _level(stream, found, number, settings)[1][one.tap.channel]
                reason = _echo(one, force, float(found.noise[one.tap.channel]), settings)
            judged[number] = replace(one, reason=reason)
    return replace(found, taps=tuple(judged))


def _damage(samples: Real, names: Sequence[str], scales: Sequence[float | None], n_forces: int) -> str:
    for column, (name, scale) in enumerate(zip(names, scales, strict=True)):
        if not np.isfinite(samples[:, column]).all():
            return f"missing samples: {name} is not finite"
        if limited(samples[:, column], scale):
            return f"overload: the {'force' if column < n_forces else 'response'} on {name} is clipped"
    return ""


def _echo(one: JudgedTap, force: Real, noise: float, settings: TapSettings) -> str:
    """Say where the force comes back with its sign after the force window has begun to fall."""
    start = settings.force_samples
    if start is None:
        return ""
    after = np.sign(one.tap.peak) * force[start:]
    if not len(after) or after.max() <= max(ECHO * abs(one.tap.peak), _ECHO_NOISE * noise):
        return ""
    delay = (start + int(np.argmax(after)) - settings.before) / settings.sample_rate
    return f"double hit: {100 * after.max() / abs(one.tap.peak):.1f} % once more after {1e3 * delay:.1f} ms"


def _rest(stream: Stream, found: FoundTaps, number: int, settings: TapSettings, places: NDArray[np.int64]) -> Real:
    """Resting level (n_samples, n_channels): a straight line from before this tap to before the next hit.

    The level before a hit is a mean under a Hann window, which the ringing of the structure passes hardly. After the
    last hit the line goes on as it came; a single tap has a constant level.
    """
    centre, level = _level(stream, found, number, settings)
    if len(found.taps) == 1:
        return np.broadcast_to(level, (len(places), len(level)))
    other = number + 1 if number + 1 < len(found.taps) else number - 1
    elsewhere, beside = _level(stream, found, other, settings)
    return np.asarray(level + np.multiply.outer((places - centre) / (elsewhere - centre), beside - level))


def _level(stream: Stream, found: FoundTaps, number: int, settings: TapSettings) -> tuple[float, Real]:
    """Middle (sample) of the quiet time before a hit, and the mean of each channel in it."""
    one = found.taps[number]
    last = one.place - rise(one, settings.sample_rate)
    first = max(0, one.place - max(settings.before, round(_QUIET * settings.length)))
    if number:
        earlier = found.taps[number - 1]
        first = max(first, min(earlier.place + rise(earlier, settings.sample_rate) * 2, last - settings.before))
    samples = stream.read(max(0, first), max(last, 1), found.test.names)
    weight = scipy.signal.windows.hann(len(samples) + 2)[1:-1]
    return (first + last - 1) / 2, np.asarray(weight @ samples / weight.sum())


def force_window(n_samples: int, sample_rate: float, duration: float) -> Real:
    """1 over the contact, then a cosine fall over a quarter of ``duration`` (s), then 0, shape (n_samples,)."""
    time = np.arange(n_samples) / sample_rate
    fall = np.clip((time - duration) / (0.25 * duration), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * fall)))


def exponential_window(n_samples: int, sample_rate: float, time_constant: float) -> Real:
    """``exp(-t / tau)`` for a response that has not died out at the segment's end, shape (n_samples,).

    Apply it to force and response alike. The transform of ``h(t) exp(-t / tau)`` is ``H(i w + 1/tau)``: the FRF is
    exact, at another place of the Laplace plane, where every pole seems to lie ``1/tau`` further to the left. Nothing
    that is done to the values line by line brings them back to ``i w``: that would be to undo the window, with the
    truncation it was there to prevent. So an FRF carries the time constant
    (``exponential_time_constant``), and the fit, which knows the poles, takes ``1/tau`` from their
    damping (:func:`without_added_damping`).

    Raises
    ------
    InputError
        A time constant that is not positive.
    """
    if not time_constant > 0:
        raise InputError(f"time constant {time_constant:g} s must be positive; leave it out for no window")
    return np.asarray(np.exp(-np.arange(n_samples) / (sample_rate * time_constant)))


def window_correlation(apart: Real, time_constant: float) -> NDArray[np.complex128]:
    """Correlation that the window gives to white noise on lines ``apart`` (Hz): ``1 / (1 + i pi apart tau)``.

    It is the transform of ``exp(-2 t / tau)`` over its value at 0 Hz, for segments of several tau. The variance on each
    line is right without it; a fit that takes lines as independent gives error bars that are too small, since the
    noise is as large as ever where the answer is, at the segment's beginning. A pole with damping ``sigma`` (rad/s),
    fitted on lines ``df`` apart, has ``2 / (tau df) ((sigma + a) / (sigma + 2 a))^3`` times that variance, a = 1/tau.

    Examples
    --------
    >>> bool(abs(window_correlation(np.array([2.0]), 0.1))[0] > 0.8)
    True
    """
    return np.asarray(1 / (1 + 1j * np.pi * np.asarray(apart) * time_constant))


def without_added_damping(poles: NDArray[np.complex128], time_constant: float) -> NDArray[np.complex128]:
    """Poles (rad/s) fitted to exponentially windowed data, freed of the window: ``s + 1/tau`` (Ewins, section 3.7).

    Examples
    --------
    >>> without_added_damping(np.array([-3 + 100j]), 0.5)
    array([-1.+100.j])
    """
    return np.asarray(poles + 1 / time_constant)
