"""How much of the response to a tap the segment's end cuts off, the window that prevents it, and mains hum."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import opened
from millfrf.core import Complex, Index, Real

from ..settings import HAMMER, PERIODS
from .segments import TapSettings, segments_of
from .tap_spectra import force_cut
from .taps import FoundTaps, SteadyTone


@dataclass(frozen=True)
class Decay:
    """The mode that rings longest in the segments of the taps."""

    left: float  # amplitude of that mode at the segment's end, as a share of its amplitude at the beginning
    frequency: float  # Hz
    response: str  # degree of freedom of the response in which it was found
    # largest share of the response to a tap that still rings when the next tap comes; 0: not found
    before: float
    hum: tuple[float, ...] = ()  # Hz; lines that ring late in the segments but were there before the first tap


def response_decay(tests: Sequence[FoundTaps], settings: TapSettings) -> Decay:
    """Estimate the share of the response of the slowest mode that the segment's end cuts off.

    Late in the segment only slow modes ring. Under a Hann window the power of such a mode falls from the middle half of
    the segment to the last half by ``exp(-2 sigma T/4)``, which gives its damping sigma and its amplitude A at the end.
    The part that is cut off, ``A / sigma``, is compared with the whole spectrum of the response on the line of the
    mode; for a single mode the share is ``exp(-sigma T)``. Only lines that exceed their neighbours in the last half
    count, because a mode is narrower than a few lines and noise is not. Hum of the mains was there in the quiet time
    before the first tap, or does not follow the taps; it is left out, and its lines are returned.

    Parameters
    ----------
    tests
        Usable taps of all tests.
    settings
        Segments; their exponential window is not applied.
    """
    decays = [_decay(responses, settings) for responses in _late_responses(tests, settings)]
    longest = max(decays, key=lambda decay: decay.left)
    hum = tuple(sorted({line for decay in decays for line in decay.hum}))
    return replace(longest, before=max(decay.before for decay in decays), hum=hum)


def window_for(left: float, settings: TapSettings) -> float | None:
    """Choose the time constant (s) with which a share ``left`` falls to 0.0003 at the segment's end.

    None where no window is needed: up to ``left`` = 0.003, the error of an FRF at its resonances is that small.

    Examples
    --------
    >>> settings = TapSettings(1000.0, 2000, 20, 60)
    >>> window_for(0.001, settings), round(window_for(0.3, settings), 4)
    (None, 0.2895)
    """
    return None if left <= HAMMER.died_out else float(settings.duration / np.log(left / HAMMER.windowed))


class _LateResponses:
    """Powers of the responses to taps under a Hann window of half a segment, averaged over the taps of a point.

    Arrays are (n_lines, n_responses); ``whole``, the power of the whole segment without a window, has 2 n_lines - 1
    lines, and ``force`` is (n_lines,).
    """

    def __init__(self, settings: TapSettings, places: tuple[str, ...]) -> None:
        self.places, self._before, self._half = places, settings.before, settings.length // 2
        n_lines = self._half // 2 + 1
        self._window = scipy.signal.windows.hann(self._half, sym=False)[:, None]
        self._cut = force_cut(settings)
        shape = (n_lines, len(places))
        self.middle, self.last = np.zeros(shape), np.zeros(shape)  # power in these halves of the segment
        self.earlier, self.undisturbed = np.zeros(shape), np.zeros(shape)  # before a tap that follows another, or none
        self.whole, self.force = np.zeros((self._half + 1, len(places))), np.zeros(n_lines)
        self._cross = np.zeros(shape, complex)
        self.n_taps = self.n_earlier = self.n_undisturbed = 0
        self.known = np.zeros(n_lines, dtype=bool)  # lines of which the quiet time before first taps holds some periods

    def add(self, force: Real, response: Real, *, follows: bool, recorded: int) -> None:
        """Add a tap from half a segment before it to the segment's end.

        ``follows``: there is an earlier tap; ``recorded``: number of samples that the recording holds before this tap.
        """
        half, quarter = self._half, len(response) - self._half - self._half // 2
        drive = np.fft.rfft(force[half:] * self._cut)[::2, None][: len(self.last)]
        last = np.fft.rfft(response[-half:] * self._window, axis=0)
        quiet = response[self._before : half + self._before]
        self._cross += last * drive.conj()
        self.last += np.abs(last) ** 2
        self.middle += _power(response[quarter : quarter + half] * self._window)
        self.whole += _power(response[half:])
        self.force += np.abs(drive[:, 0]) ** 2
        self.n_taps += 1
        if follows:
            self.earlier += _power(quiet * self._window)
            self.n_earlier += 1
            return
        length = min(recorded, half)
        known = np.arange(len(self.known)) * length >= HAMMER.lowest_line * half
        if known.any():
            # a shorter window of the same sum: a tone keeps its power
            window = np.zeros((half, 1))
            window[half - length :, 0] = scipy.signal.windows.hann(length, sym=False)
            self.undisturbed += _power(quiet * window * (self._window.sum() / window.sum()))
            self.known = known & (self.known | (self.n_undisturbed == 0))
            self.n_undisturbed += 1

    def average(self) -> None:
        """Divide the sums of powers by the numbers of taps; compute the coherence of force and last half."""
        product = self.last * self.force[:, None]
        self.coherence = np.abs(self._cross) ** 2 / np.where(product > 0, product, 1.0)
        for power in (self.middle, self.last, self.whole):
            power /= self.n_taps
        self.earlier /= max(1, self.n_earlier)
        self.undisturbed /= max(1, self.n_undisturbed)


def _power(samples: Real) -> Real:
    return np.asarray(np.abs(np.fft.rfft(samples, axis=0)) ** 2)


def _late_responses(tests: Sequence[FoundTaps], settings: TapSettings) -> list[_LateResponses]:
    """Average the responses for each point that was hit and each set of responses."""
    sums: dict[tuple[str, tuple[str, ...]], _LateResponses] = {}
    half = settings.length // 2
    for test in tests:
        excitations = test.test.excitations
        places = tuple(channel.degree_of_freedom for channel in test.test.responses)
        for number, samples in segments_of(test, settings, before=half):
            tap = test.taps[number]
            key = (excitations[tap.tap.channel].degree_of_freedom, places)
            if key not in sums:
                sums[key] = _LateResponses(settings, places)
            force, response = samples[:, tap.tap.channel], samples[:, len(excitations) :]
            sums[key].add(force, response, follows=number > 0, recorded=tap.place)
    for responses in sums.values():
        responses.average()
    return list(sums.values())


def _decay(responses: _LateResponses, settings: TapSettings) -> Decay:
    rings, hums = _rings(responses)
    hum = tuple(
        float(line * settings.sample_rate / (settings.length // 2)) for line in np.flatnonzero(hums.any(axis=1))
    )
    if not rings.any():
        return Decay(0.0, 0.0, "", 0.0, hum)
    last = np.sqrt(responses.last)
    # every second line of the whole segment is a line of a half; a resonance may lie between
    whole = np.sqrt(scipy.ndimage.maximum_filter1d(responses.whole, 3, axis=0)[::2][: len(last)])
    falls = rings & (responses.middle > 0)
    lost = np.log(np.divide(responses.middle, responses.last, out=np.ones_like(whole), where=falls))
    # sigma T; the power falls by exp(-2 sigma T / 4) from the middle to the last half
    damping = np.clip(2 * lost, HAMMER.least_damping, None)
    tail = 4 / damping * np.exp(-damping / 4)
    # amplitude at the end over sigma: what the segment cuts off, compared with the whole response on that line
    cut = np.where(rings, last * tail, 0.0)
    left = cut / np.where(rings, cut + whole, 1.0)
    earlier_rings = rings & _exceeds_neighbours(responses.earlier, responses.n_earlier)
    before = np.where(earlier_rings, np.sqrt(responses.earlier) * tail * -np.expm1(-damping), 0.0)
    line, column = np.unravel_index(int(np.argmax(left)), left.shape)
    return Decay(
        float(left[line, column]),
        float(line * settings.sample_rate / (settings.length // 2)),
        responses.places[int(column)],
        min(1.0, float((before / np.where(rings, whole, 1.0)).max())),
        hum,
    )


def _rings(responses: _LateResponses) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the lines and responses at which a mode still rings in the last half of the segments, and those of hum."""
    last, driven = responses.last, responses.force > HAMMER.band * responses.force.max()
    driven[: HAMMER.lowest_line] = False
    peaks = np.zeros(last.shape, dtype=bool)
    peaks[1:-1] = (last[1:-1] >= last[:-2]) & (last[1:-1] >= last[2:])
    strong = responses.whole[::2][: len(last)] > HAMMER.strong * responses.whole.max(axis=0)
    # hum was there before the first tap
    new = last > HAMMER.excess * np.where(responses.known[:, None], responses.undisturbed, 0.0)
    late = peaks & driven[:, None] & strong & _exceeds_neighbours(last, responses.n_taps)
    rings = late & new & _follows_taps(responses)
    # noise of a short quiet time may hide a mode, but is no hum
    hum = late & ~new & _exceeds_neighbours(responses.undisturbed, responses.n_undisturbed)
    return rings, hum


def _follows_taps(responses: _LateResponses) -> NDArray[np.bool_]:
    """Return the lines and responses on which the late signal is a response to the taps, not hum.

    The signal must be coherent with the force from tap to tap, or fall. Lines pass where the quiet time before the
    first tap holds some of their periods, with which :func:`_rings` compares, and all for a single tap, which cannot
    show the difference.
    """
    n_taps = responses.n_taps
    if n_taps == 1:
        return np.ones(responses.last.shape, dtype=bool)
    # noise of n averages exceeds this coherence with the given probability
    by_chance = 1 - HAMMER.chance_coherence ** (1 / (n_taps - 1))
    coherent = responses.coherence > min(by_chance, HAMMER.sufficient_coherence)
    return np.asarray(responses.known[:, None] | coherent | (responses.last < HAMMER.falling * responses.middle))


def _exceeds_neighbours(power: Real, n_taps: int) -> NDArray[np.bool_]:
    """Return where a power exceeds that of the lines around by more than noise does on one line of a million."""
    if not n_taps:
        return np.zeros(power.shape, dtype=bool)
    around = scipy.ndimage.median_filter(power, size=(min(HAMMER.neighbours, len(power)), 1), mode="nearest")
    by_chance = scipy.stats.chi2.isf(HAMMER.false_peak, 2 * n_taps) / scipy.stats.chi2.median(2 * n_taps)
    return np.asarray(power > max(HAMMER.excess, by_chance) * around)


def without_hum(taps: FoundTaps) -> FoundTaps:
    """Find hum of the mains in a test; ``segments_of`` subtracts it.

    A tone ``Re(a exp(2 pi i f t))`` near a multiple of the mains is fitted by least squares to the time before the
    first hit and the second half of the time between hits, with one phase for the whole recording. It is hum if its
    power exceeds that of neighbouring frequencies by an F-test, and if it leaves less than a quarter of the line's
    power in the time before the first hit: what a tap has set in motion was not there.

    Parameters
    ----------
    taps
        All hits of one test.
    """
    if taps.sample_rate <= 2 * min(PERIODS.mains):  # no multiple of the mains lies below the Nyquist frequency
        return taps
    starts, block = _quiet_blocks(taps)
    if len(starts) < 2 or starts[0] + block > taps.taps[0].place:
        return taps
    multiples = {mains * multiple for mains in PERIODS.mains for multiple in range(1, HAMMER.hum_harmonics + 1)}
    nominal = np.array(sorted(f for f in multiples if f < taps.sample_rate / 2 - taps.sample_rate / block))
    lines, spacing = np.rint(nominal * block / taps.sample_rate).astype(np.int64), taps.sample_rate / block
    amplitudes = _amplitudes_of_blocks(taps, starts, block, lines)
    times, silent = np.asarray((starts + block / 2) / taps.sample_rate), starts + block <= taps.taps[0].place
    power = np.mean(np.abs(amplitudes) ** 2, axis=0)
    strength = np.max(power / np.maximum(power.max(axis=0), 1e-300), axis=1)
    tones = []
    # the strongest first: the window lets a little of it through on other lines
    for k in np.argsort(-strength):
        tone = _tone(amplitudes[:, k], times, float(lines[k]) * spacing, float(nominal[k]), silent)
        if tone is not None:
            tones.append(tone)
            turns = np.exp(2j * np.pi * tone.frequency / taps.sample_rate * (starts[:, None] + np.arange(block)))
            amplitudes -= _amplitudes(turns[:, :, None], starts, lines) * (tone.amplitudes / 2)
    return replace(taps, tones=tuple(sorted(tones, key=lambda tone: tone.frequency)))


def _quiet_blocks(taps: FoundTaps) -> tuple[Index, int]:
    """Return first samples of blocks before the first hit and late between hits, and the samples of a block."""
    block = round(HAMMER.hum_block * taps.sample_rate)
    hits = [tap.place - round(HAMMER.rise * tap.tap.contact * taps.sample_rate) for tap in taps.taps]
    begins = [0, *((tap.place + stop) // 2 for tap, stop in zip(taps.taps, [*hits[1:], taps.n_samples], strict=True))]
    blocks = [
        begin + block * np.arange(max(0, stop - begin) // block)
        for begin, stop in zip(begins, [*hits, taps.n_samples], strict=True)
    ]
    return np.concatenate(blocks).astype(np.int64), block


def _amplitudes_of_blocks(taps: FoundTaps, starts: Index, block: int, lines: Index) -> Complex:
    """Return the amplitudes of the blocks of a recording on some lines, (n_blocks, n_lines, n_channels)."""
    with opened(taps.test.path) as recording:
        stream = recording.stream(taps.test.stream)
        parts = []
        for some in np.array_split(starts, 1 + len(starts) // HAMMER.hum_blocks):
            samples = [stream.read(start, start + block, taps.test.names) for start in some.tolist()]
            parts.append(_amplitudes(np.stack(samples), some, lines))
    return np.concatenate(parts)


def _amplitudes(samples: Real | Complex, starts: Index, lines: Index) -> Complex:
    """Return amplitudes of samples (n_blocks, block, n_channels) under a Hann window, with the phases at sample 0.

    The window has zeros two lines away, where the other mains frequency is.
    """
    block = samples.shape[1]
    window = scipy.signal.windows.hann(block, sym=False)
    basis = window * np.exp(-2j * np.pi * np.multiply.outer(lines, np.arange(block)) / block)
    centred = samples - samples.mean(axis=1, keepdims=True)
    turns = np.exp(-2j * np.pi * np.multiply.outer(starts / block, lines))[:, :, None]
    return np.asarray(2 / window.sum() * (basis @ centred) * turns)


def _tone(z: Complex, times: Real, line: float, nominal: float, silent: NDArray[np.bool_]) -> SteadyTone | None:
    """Fit a tone near ``nominal`` (Hz) to amplitudes z (n_blocks, n_channels) that were demodulated at ``line`` (Hz).

    ``times`` (s) are the middles of the blocks, ``silent`` those before the first hit.
    """
    duration = float(times[-1] - times[0])
    count = min(HAMMER.neighbours, int(HAMMER.hum_around * duration))
    if count < 2:
        return None
    reach = HAMMER.hum_reach * nominal
    offsets = nominal - line + np.linspace(-reach, reach, 8 * int(np.ceil(2 * reach * duration)) + 1)
    step, rest = float(offsets[1] - offsets[0]), z
    offset = float(offsets[np.argmax(_explained(offsets, z / _deviation(z), times))])
    for _ in range(2):  # each channel counts by what the last fit left in it
        weighted = z / _deviation(rest)
        best = scipy.optimize.minimize_scalar(
            lambda x, weighted: -float(_explained(np.array([x]), weighted, times)[0]),
            bounds=(offset - step, offset + step),
            args=(weighted,),
            method="bounded",
            options={"xatol": HAMMER.hum_phase / duration},
        )
        offset = float(best.x)
        amplitude = _means(z, np.array([offset]), times)[0]
        rest = z - np.multiply.outer(np.exp(2j * np.pi * offset * times), amplitude)
    beside = offset + np.concatenate([np.arange(-count, 0), np.arange(1, count + 1)]) / duration
    noise = np.mean(np.abs(_means(rest, beside, times)) ** 2, axis=0)
    tail = scipy.stats.f.sf(np.abs(amplitude) ** 2 / np.maximum(noise, 1e-300), 2, 4 * count)
    before = _means(z[silent], np.array([offset]), times[silent])[0]
    there = np.abs(before) ** 2 > HAMMER.excess * np.abs(before - amplitude) ** 2
    hum = there & (tail * len(offsets) * z.shape[1] < HAMMER.false_peak)
    return SteadyTone(line + offset, np.where(hum, amplitude, 0.0)) if hum.any() else None


def _means(z: Complex, offsets: Real, times: Real) -> Complex:
    """Return the amplitudes (n_offsets, n_channels) of tones ``offsets`` (Hz) off the line."""
    return np.asarray(np.exp(-2j * np.pi * np.multiply.outer(offsets, times)) @ z / len(times))


def _explained(offsets: Real, weighted: Complex, times: Real) -> Real:
    return np.asarray(np.sum(np.abs(_means(weighted, offsets, times)) ** 2, axis=1))


def _deviation(z: Complex) -> Real:
    """Return the root mean square of each channel, (n_channels,)."""
    return np.asarray(np.maximum(np.sqrt(np.mean(np.abs(z) ** 2, axis=0)), 1e-300))
