"""Foreign tones in a recording, inside and above the compared band."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.core import Complex, Real

from ..inference.settings import FAULTS, FaultSettings
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis, predict_lines
from ..models.misfit import fitted_noise, levels, through_structure
from ..noise.noise_model import NoiseModel, whitening

NEAR = np.ones(41, dtype=bool)
"""Lines of a neighbourhood."""

BESIDE = np.array([abs(k) > 3 for k in range(-10, 11)])
"""Lines beside a line, without those that a tone reaches: a narrow resonance is as high there."""

REACH = 10
"""Lines on each side that a tone reaches through the window."""

AS_SHARP = 20
"""Lines within which the half-power bandwidth of a mode must lie for its resonance to look like a tone."""


@dataclass(frozen=True)
class Tone:
    """A steady tone that the forces do not know.

    Parameters
    ----------
    frequency
        Frequency of the tone, Hz.
    amplitudes : (n_responses,)
        Amplitude in each response, in the response's unit, mean over recordings.
    gain
        Twice the logarithm of the likelihood that the tone gains.
    spread : (n_responses,)
        Standard error of the amplitudes, in their units: how far recordings differ, widened where they are few.
    """

    frequency: float
    amplitudes: Real
    gain: float
    spread: Real

    def is_steady(self, most_varied: float, recordings: int) -> bool:
        """Tell whether the amplitude in any response is much the same in all recordings; True for a single one.

        Parameters
        ----------
        most_varied
            Standard deviation over mean up to which an amplitude is the same.
        recordings
            Number of recordings that the amplitudes were taken from.

        Examples
        --------
        >>> Tone(39.9, np.array([0.009, 0.021]), 302.0, np.array([0.007, 0.0165])).is_steady(0.3, 3)
        False
        """
        if recordings < 2:
            return True
        return bool((self.spread <= most_varied * _widened(recordings) * self.amplitudes).any())


def mean_and_error(sizes: list[Real]) -> tuple[Real, Real]:
    """Mean over recordings of amplitudes (n_responses,) each, and its standard error: 1.96 of it make 95 %.

    The spread is widened by Student's t and not divided by the number of recordings, as a tone that changes from one
    to the next has no one amplitude; of a single recording no error is known (not a number).

    Examples
    --------
    >>> mean, error = mean_and_error([np.array([1.0]), np.array([1.2]), np.array([1.1])])
    >>> float(mean[0].round(3)), float(error[0].round(3))
    (1.1, 0.22)
    """
    mean = np.asarray(np.mean(sizes, axis=0))
    if len(sizes) < 2:
        return mean, np.full(len(mean), np.nan)
    return mean, np.asarray(np.std(sizes, axis=0, ddof=1) * _widened(len(sizes)))


def _widened(recordings: int) -> float:
    """Factor on a standard deviation over few recordings, of which 1.96 then make 95 %."""
    return float(scipy.stats.t.ppf(0.975, recordings - 1)) / 1.96


def find_tone(fitted: Fit, lines: list[WindowedSpectrum], settings: FaultSettings = FAULTS) -> Tone | None:
    """The strongest residual line that stands out of the recordings at one frequency, and of no force.

    Noise grows with the signal, so a tone from elsewhere is weaker beside the noise where the forces are larger. It
    must be seen in two recordings (in the only one, where there is one).

    Parameters
    ----------
    fitted
        The fit whose residual is searched.
    lines
        Recordings to which it was fitted.
    settings
        Thresholds of the tests for tones and clipping.
    """
    if len(lines) == 0:
        return None
    powers = [_whitened_power(fitted, one, noise) for one, noise in zip(lines, fitted.noises, strict=True)]
    together = seen_together([sharp_contrast(power) for power in powers], lines, settings.forced, settings)
    axis = lines[0].frequencies
    if is_comb(together, settings):
        return None
    for k in np.argsort(-together)[:20]:
        if together[k] < settings.contrast:
            return None
        frequency = float(axis[k])
        if _too_few_left(lines, frequency) or _at_a_sharp_resonance(fitted, lines, frequency):
            continue
        exact = sharp_frequency(_rests(fitted, lines), [one.recording.rate for one in lines], frequency)
        # the lines beside it seemed to stand out as much; how strong it is does not depend on how far it leaks
        shown = [_at(above_neighbours(power, NEAR), one, exact) for one, power in zip(lines, powers, strict=True)]
        return tone_beside(fitted, lines, exact, 2 * float(np.sum(shown)))
    return None


def tone_beside(fitted: Fit, lines: list[WindowedSpectrum], frequency: float, gain: float) -> Tone:
    """A tone with the amplitudes that a fit leaves of it.

    Parameters
    ----------
    fitted
        A fit, whose residual holds the tone.
    lines
        Recordings from which the tone was not taken out.
    frequency
        Frequency of the tone, Hz.
    gain
        Twice the logarithm of the likelihood that the tone gains.
    """
    sizes, spread = mean_and_error(_amplitudes(fitted, lines, frequency))
    return Tone(frequency, sizes, gain, spread)


def seen_together(
    contrasts: list[Real], lines: list[WindowedSpectrum], forced: float, settings: FaultSettings = FAULTS
) -> Real:
    """Contrast of each line of the first recording (n_lines,), summed over recordings; 0 where the line is no tone.

    A line of another recording counts with those beside it. Two recordings must show it (the only one, where there is
    one), and no force with a contrast above ``forced``.

    Parameters
    ----------
    contrasts : each (n_lines,)
        Contrast of each line of each recording.
    lines
        The recordings, in the same order.
    forced
        Contrast of a force at a line from which the line counts as caused by the forces.
    settings
        Thresholds of the tests for tones and clipping.
    """
    axis = lines[0].frequencies
    each = [
        np.max([np.interp(axis + shift * _step(one), one.frequencies, c) for shift in (-1, 0, 1)], axis=0)
        for one, c in zip(lines, contrasts, strict=True)
    ]
    again = np.sort(each, axis=0)[-min(2, len(lines))]
    pushed = [np.interp(axis, one.frequencies, force_contrast(one)) > forced for one in lines]
    return np.where((again > settings.seen_again) & ~np.any(pushed, axis=0), np.sum(each, axis=0), 0.0)


def is_comb(contrast: Real, settings: FaultSettings = FAULTS) -> bool:
    """Whether more lines stand out than a machine nearby makes.

    Forces that repeat within the record cause a comb of lines, and errors of the model appear on the same lines.

    Parameters
    ----------
    contrast : (n_lines,)
        Contrast of each line, summed over recordings.
    settings
        Thresholds of the tests for tones and clipping.
    """
    lines = np.flatnonzero(contrast > settings.contrast / 3)
    return int(np.sum(np.diff(lines, prepend=-REACH) > 2)) > settings.most_lines


def stands_out(fitted: Fit, lines: list[WindowedSpectrum], frequency: float, settings: FaultSettings = FAULTS) -> bool:
    """Whether a line of recordings that still hold it is a tone beside what a fit leaves.

    Parameters
    ----------
    fitted
        The fit with all causes.
    lines
        Recordings from which no tone was taken out.
    frequency
        Frequency of the line, Hz.
    settings
        Thresholds of the tests for tones and clipping.
    """
    total = 0.0
    for one, noise in zip(lines, fitted.noises, strict=True):
        power = _whitened_power(fitted, one, noise)
        total += _at(sharp_contrast(power), one, frequency)
    return total > settings.contrast


def _at(contrast: Real, lines: WindowedSpectrum, frequency: float) -> float:
    """The largest of the lines (n_lines,) about a frequency, Hz."""
    return float(contrast[np.abs(lines.frequencies - frequency) < 1.5 * _step(lines)].max(initial=0.0))


def _rests(fitted: Fit, lines: list[WindowedSpectrum]) -> list[Real]:
    """Windowed residuals in time, (n_kept, n_responses) each."""
    rests = [one.recording.response - shown_signal(fitted, one) for one in lines]
    return [
        rest[one.start : one.start + len(one.window)] * one.window[:, None]
        for rest, one in zip(rests, lines, strict=True)
    ]


def sharp_frequency(windowed: list[Real], rates: list[float], near: float) -> float:
    """Peak (Hz) of windowed signals' spectra about a line, forty points a line, all recordings together.

    Parameters
    ----------
    windowed : each (n_kept, n_channels)
        Signals in time, multiplied by their windows.
    rates
        Sample rates of the signals, Hz.
    near
        Frequency of the line, Hz.
    """
    step = max(rate / len(kept) for kept, rate in zip(windowed, rates, strict=True))
    tries = near + step * np.linspace(-2, 2, 161)
    power = np.zeros(len(tries))
    for kept, rate in zip(windowed, rates, strict=True):
        waves = np.exp(-2j * np.pi * tries[:, None] * np.arange(len(kept)) / rate)
        power += np.sum(np.abs(waves @ kept) ** 2, axis=1)
    return float(tries[np.argmax(power)])


def without_tone(fitted: Fit, lines: WindowedSpectrum, tone: Tone) -> WindowedSpectrum:
    """The same recording without the tone, and without the lines about it.

    The sinusoid that fits the residual best is subtracted: otherwise a strong tone's leakage through the window would
    stand out far from it. The lines near the tone are dropped, as a tone that wavers is not subtracted wholly.
    """
    rest = lines.recording.response - shown_signal(fitted, lines)
    turn = 2 * np.pi * tone.frequency * np.arange(len(rest)) / lines.recording.rate
    waves = np.column_stack([np.cos(turn), np.sin(turn)])
    response = lines.recording.response - waves @ np.linalg.lstsq(waves, rest, rcond=None)[0]
    kept = np.abs(lines.frequencies - tone.frequency) > REACH * _step(lines)
    return replace(
        lines,
        recording=replace(lines.recording, response=response),
        band=lines.band[kept],
        frequencies=lines.frequencies[kept],
        force_here=lines.force_here[kept],
        measured=lines.cut(response)[kept],
        trust=lines.trust[kept],
    )


def shown_signal(fitted: Fit, lines: WindowedSpectrum) -> Real:
    """Predicted responses in time, (n_samples, n_responses)."""
    spectrum = predict_lines(fitted.hypothesis, lines).spectrum
    return np.asarray(scipy.fft.irfft(spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])


def _step(lines: WindowedSpectrum) -> float:
    return lines.recording.rate / len(lines.window)


def _whitened_power(fitted: Fit, lines: WindowedSpectrum, noise: NoiseModel) -> Real:
    """Power of each residual line in units of its noise, mean over channels."""
    rest = lines.measured - predict_lines(fitted.hypothesis, lines).response
    own = fitted_noise(lines, through_structure(fitted.hypothesis, lines), noise)
    return np.asarray(np.sum(np.abs(np.einsum("kij,kj->ki", whitening(own), rest)) ** 2, axis=1) / rest.shape[1])


def sharp_contrast(power: Real) -> Real:
    """Each line of a power (n_lines,) over its neighbourhood and over the lines just beside it, the smaller of both."""
    return np.minimum(above_neighbours(power, NEAR), above_neighbours(power, BESIDE))


def above_neighbours(power: Real, footprint: NDArray[np.bool_]) -> Real:
    """Each line of a power (n_lines,) over the median of the lines about it that the footprint holds."""
    # mirrored at its ends: a weak last line repeated would make its neighbours stand out
    around = scipy.ndimage.median_filter(power, footprint=footprint, mode="mirror")
    return np.asarray(power / np.maximum(around, 1e-3 * power.mean() + 1e-300))


def _too_few_left(lines: list[WindowedSpectrum], frequency: float) -> bool:
    """Whether taking the tone out would leave less than three quarters of any recording's lines."""
    reach = [np.abs(one.frequencies - frequency) <= REACH * _step(one) for one in lines]
    return any(near.sum() > 0.25 * len(near) for near in reach)


def _at_a_sharp_resonance(fitted: Fit, lines: list[WindowedSpectrum], frequency: float) -> bool:
    """Whether a mode lies there whose resonance is hardly wider than a tone: a shift of it leaves as sharp a line."""
    model = fitted.hypothesis.model
    step = max(_step(one) for one in lines)
    widths = 2 * model.damping_ratios * model.natural_frequencies
    near = np.abs(model.natural_frequencies - frequency) < np.maximum(widths, 3 * step)
    return bool((near & (widths < AS_SHARP * step)).any())


def force_contrast(lines: WindowedSpectrum) -> Real:
    """Power of the forces at each line or beside it against the median of its neighbourhood, (n_lines,)."""
    power = np.sum(np.abs(lines.force_here / levels(lines)[1]) ** 2, axis=1)
    return np.asarray(scipy.ndimage.maximum_filter(above_neighbours(power, NEAR), 3))


def _amplitudes(fitted: Fit, lines: list[WindowedSpectrum], frequency: float) -> list[Real]:
    found = []
    for one in lines:
        rest = one.measured - predict_lines(fitted.hypothesis, one).response
        k = int(np.argmin(np.abs(one.frequencies - frequency)))
        power = np.sum(np.abs(rest[max(0, k - 2) : k + 3]) ** 2, axis=0)
        found.append(2 * np.sqrt(power / len(one.window)))
    return found


HIGHEST = 0.45
"""Highest frequency looked at, as a share of the sample rate."""


def tones_beyond(
    hypothesis: Hypothesis,
    lines: list[WindowedSpectrum],
    decay: float,
    most: int,
    settings: FaultSettings = FAULTS,
    clipped: Collection[str] = (),
) -> list[Tone]:
    """Lines above the compared band that stand out of the residual in two recordings, and in no force.

    No noise was fitted there, so each response is its own measure: a line's power against the median of its neighbours.
    The hypothesis is the final one: a hardening joint answers periodic forces at frequencies that the forces lack.

    Parameters
    ----------
    hypothesis
        The hypothesis with all causes.
    lines
        Windowed lines of the recordings.
    decay
        Decay rate of the slowest mode, 1/s.
    most
        Number of tones that are looked for at most.
    settings
        Thresholds of the tests for tones. No force may show more contrast there than ``quiet_force``: above the modes
        a force's line needs no resonance to be seen in a response.
    clipped
        Channels that clip, which are not looked at: a limit makes harmonics of all that repeats.

    Returns
    -------
    list of Tone
        Tones that were found, strongest first.
    """
    above = [_above(one, decay) for one in lines]
    if not above or min(len(one.frequencies) for one in above) < 4 * len(NEAR):
        return []
    names = above[0].recording.channels[-above[0].measured.shape[1] :]
    kept = [k for k, name in enumerate(names) if name not in clipped]
    if not kept:
        return []
    rests = [one.measured - predict_lines(hypothesis, one).response for one in above]
    powers = [np.abs(rest[:, kept]) ** 2 for rest in rests]
    contrasts = [np.mean([sharp_contrast(column) for column in power.T], axis=0) for power in powers]
    together = seen_together(contrasts, above, settings.quiet_force, settings)
    axis, found = above[0].frequencies, list[Tone]()
    if is_comb(together, settings):
        return found
    while len(found) < most and together.max() > settings.contrast:
        k = int(np.argmax(together))
        found.append(_tone(above, rests, float(axis[k]), float(together[k])))
        together[max(0, k - REACH) : k + REACH + 1] = 0.0
    return found


def _above(lines: WindowedSpectrum, decay: float) -> WindowedSpectrum:
    rate = lines.recording.rate
    return windowed_spectrum(
        lines.recording, (float(lines.frequencies[-1]) + REACH / lines.recording.duration, HIGHEST * rate), decay
    )


def _tone(above: list[WindowedSpectrum], rests: list[Complex], near: float, contrast: float) -> Tone:
    kept = [one.recording.response[one.start : one.start + len(one.window)] * one.window[:, None] for one in above]
    frequency = sharp_frequency(kept, [one.recording.rate for one in above], near)
    sizes = []
    for one, rest in zip(above, rests, strict=True):
        k = int(np.argmin(np.abs(one.frequencies - frequency)))
        power = np.sum(np.abs(rest[max(0, k - 2) : k + 3]) ** 2, axis=0)
        sizes.append(2 * np.sqrt(power / len(one.window)))
    mean, spread = mean_and_error(sizes)
    return Tone(frequency, mean, 2 * contrast, spread)
