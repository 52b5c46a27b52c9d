"""Cut taps out of a recording: resting level and drift taken off, overload and late second hits left out."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import hann

from acquisition import Recording, Stream

from .screening import FoundTaps, JudgedTap, limited
from .segments import TapSettings, rise

Real = NDArray[np.float64]
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
    with Recording(found.test.path) as recording:
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
    with Recording(found.test.path) as recording:
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
    weight = hann(len(samples) + 2)[1:-1]
    return (first + last - 1) / 2, np.asarray(weight @ samples / weight.sum())
