"""Extraneous tones in a recording, within and above the compared band."""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.core import Complex, Real

from ..inference.settings import FAULTS, FaultSettings
from ..models.first_motion import predict_lines
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..models.misfit import fitted_noise, levels, through_structure
from ..records.noise_model import NoiseModel, whitening

NEAR = np.ones(41, dtype=bool)  # lines of a neighbourhood, including the line in the middle

# close lines, without the lines to which a tone leaks most; a narrow resonance is as high there as in the middle
CLOSE = np.array([abs(k) > 3 for k in range(-10, 11)])

REACH = 10  # lines on each side to which a tone leaks through the window

SHARP_LINES = 20  # half-power bandwidth in lines below which a resonance looks like a tone


@dataclass(frozen=True)
class Tone:
    """A steady tone that the forces do not contain."""

    frequency: float  # frequency of the tone, Hz
    amplitudes: Real  # amplitude in each response, in the response's unit, mean over recordings, (n_responses,)
    gain: float
    # standard error of the amplitudes, in their units, (n_responses,): scatter between recordings, widened by Student's
    # t for few recordings
    spread: Real

    def is_steady(self, most_varied: float, recordings: int) -> bool:
        """Return whether the amplitude in any response is similar in all recordings; True for a single recording.

        Examples
        --------
        >>> Tone(39.9, np.array([0.009, 0.021]), 302.0, np.array([0.007, 0.0165])).is_steady(0.3, 3)
        False
        """
        if recordings < 2:
            return True
        return bool((self.spread <= most_varied * _widened(recordings) * self.amplitudes).any())


def mean_and_error(sizes: list[Real]) -> tuple[Real, Real]:
    """Return the mean over recordings of amplitudes, each (n_responses,), and its standard error.

    The standard error is the standard deviation between recordings, widened by Student's t. It is not divided by the
    number of recordings, as a tone that changes has no single amplitude. For a single recording it is NaN.

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
    """Return the factor on a standard deviation over recordings with which 1.96 errors are a 95 % interval."""
    return float(scipy.stats.t.ppf(0.975, recordings - 1)) / 1.96


def find_tone(fitted: Fit, lines: list[WindowedSpectrum], settings: FaultSettings = FAULTS) -> Tone | None:
    """Return the tone at the residual line with the largest summed contrast; None if no line is a tone.

    No force may have a line there. Noise grows with the signal, so that an extraneous tone has less contrast under
    larger forces. It must be visible in two recordings (or in the only one).
    """
    if len(lines) == 0:
        return None
    powers = [_whitened_power(fitted, recording, noise) for recording, noise in zip(lines, fitted.noises, strict=True)]
    contrast = summed_contrast([sharp_contrast(power) for power in powers], lines, settings.forced, settings)
    axis = lines[0].frequencies
    if is_comb(contrast, settings):
        return None
    for k in np.argsort(-contrast)[:20]:
        if contrast[k] < settings.contrast:
            return None
        frequency = float(axis[k])
        if _too_few_left(lines, frequency) or _at_a_sharp_resonance(fitted, lines, frequency):
            continue
        exact = sharp_frequency(
            _windowed_residuals(fitted, lines), [recording.recording.rate for recording in lines], frequency
        )
        # the contrast over the whole neighbourhood, as the strength of a tone does not depend on its leakage
        contrasts = [
            _at(above_neighbours(power, NEAR), recording, exact) for recording, power in zip(lines, powers, strict=True)
        ]
        return tone_of_residual(fitted, lines, exact, 2 * float(np.sum(contrasts)))
    return None


def tone_of_residual(fitted: Fit, lines: list[WindowedSpectrum], frequency: float, gain: float) -> Tone:
    """Return a tone with its amplitudes in the residual of a fit.

    ``frequency``: frequency of the tone, Hz.
    """
    sizes, spread = mean_and_error(_amplitudes(fitted, lines, frequency))
    return Tone(frequency, sizes, gain, spread)


def summed_contrast(
    contrasts: list[Real], lines: list[WindowedSpectrum], forced: float, settings: FaultSettings = FAULTS
) -> Real:
    """Return the contrast of each line of the first recording, summed over recordings, (n_lines,); 0 if it is no tone.

    In the further recordings the largest of the neighbouring lines counts. A tone must be visible in two recordings (or
    in the only one), and no force may have a contrast above ``forced`` there.

    ``contrasts``: contrast of each line of each recording, each (n_lines,).
    """
    axis = lines[0].frequencies
    each = [
        np.max([np.interp(axis + shift * _step(recording), recording.frequencies, c) for shift in (-1, 0, 1)], axis=0)
        for recording, c in zip(lines, contrasts, strict=True)
    ]
    again = np.sort(each, axis=0)[-min(2, len(lines))]
    pushed = [np.interp(axis, recording.frequencies, force_contrast(recording)) > forced for recording in lines]
    pushed += [np.interp(axis, recording.frequencies, harmonics_of_drive(recording)) > 0 for recording in lines]
    return np.where((again > settings.seen_again) & ~np.any(pushed, axis=0), np.sum(each, axis=0), 0.0)


def harmonics_of_drive(lines: WindowedSpectrum) -> Real:
    """Return 1 for each line at a multiple of a force that is a single tone, otherwise 0, (n_lines,).

    A nonlinearity answers a sine with its harmonics, which are therefore no extraneous tones.
    """
    result = np.zeros(len(lines.frequencies))
    for force, spectrum in zip(lines.recording.force.T, lines.force_here.T, strict=True):
        power, largest = np.abs(spectrum) ** 2, int(np.argmax(np.abs(spectrum)))
        if not power[max(largest - 2, 0) : largest + 3].sum() > 0.5 * power.sum():
            continue
        # a slow drive whose lobe reaches 0 Hz is no tone
        if lines.frequencies[largest] < 3 * _step(lines):
            continue
        windowed = force[lines.start : lines.start + len(lines.window), None] * lines.window[:, None]
        drive = sharp_frequency([windowed], [lines.recording.rate], float(lines.frequencies[largest]))
        order = lines.frequencies / drive
        result[np.abs(order - np.rint(order)) * drive < 1.5 * _step(lines)] = 1.0
    return result


def is_comb(contrast: Real, settings: FaultSettings = FAULTS) -> bool:
    """Return whether more lines have a large contrast than an extraneous source causes.

    Forces that repeat within the recording cause a comb of lines, and errors of the model appear on the same lines.

    ``contrast``: contrast of each line, summed over recordings, (n_lines,).
    """
    lines = np.flatnonzero(contrast > settings.contrast / 3)
    return int(np.sum(np.diff(lines, prepend=-REACH) > 2)) > settings.most_lines


def has_contrast(
    fitted: Fit, lines: list[WindowedSpectrum], frequency: float, settings: FaultSettings = FAULTS
) -> bool:
    """Return whether a line is a tone in the residual of a fit, for recordings from which it was not removed.

    ``frequency``: frequency of the line, Hz.
    """
    total = 0.0
    for recording, noise in zip(lines, fitted.noises, strict=True):
        power = _whitened_power(fitted, recording, noise)
        total += _at(sharp_contrast(power), recording, frequency)
    return total > settings.contrast


def _at(contrast: Real, lines: WindowedSpectrum, frequency: float) -> float:
    """Return the largest of the lines (n_lines,) around a frequency, Hz."""
    return float(contrast[np.abs(lines.frequencies - frequency) < 1.5 * _step(lines)].max(initial=0.0))


def _windowed_residuals(fitted: Fit, lines: list[WindowedSpectrum]) -> list[Real]:
    """Return the windowed residual of each recording in time, (n_samples in the window, n_responses)."""
    rests = [recording.recording.response - predicted_signal(fitted, recording) for recording in lines]
    return [
        residual[recording.start : recording.start + len(recording.window)] * recording.window[:, None]
        for residual, recording in zip(rests, lines, strict=True)
    ]


def sharp_frequency(windowed: list[Real], rates: list[float], near: float) -> float:
    """Return the peak (Hz) of the spectra of windowed signals near a line, with forty points per line.

    The signals (n_samples, n_channels) have the sample rates ``rates``, Hz; the line has the frequency ``near``, Hz.
    """
    step = max(rate / len(signal) for signal, rate in zip(windowed, rates, strict=True))
    tries = near + step * np.linspace(-2, 2, 161)
    power = np.zeros(len(tries))
    for signal, rate in zip(windowed, rates, strict=True):
        waves = np.exp(-2j * np.pi * tries[:, None] * np.arange(len(signal)) / rate)
        power += np.sum(np.abs(waves @ signal) ** 2, axis=1)
    return float(tries[np.argmax(power)])


def without_tone(fitted: Fit, lines: WindowedSpectrum, tone: Tone) -> WindowedSpectrum:
    """Return the recording without the tone, and without the lines around it.

    The sinusoid that fits the residual best is subtracted, as the leakage of a strong tone has contrast far from it.
    The lines near the tone are dropped, as the subtraction of a fluctuating tone is incomplete.
    """
    residual = lines.recording.response - predicted_signal(fitted, lines)
    turn = 2 * np.pi * tone.frequency * np.arange(len(residual)) / lines.recording.rate
    waves = np.column_stack([np.cos(turn), np.sin(turn)])
    response = lines.recording.response - waves @ np.linalg.lstsq(waves, residual, rcond=None)[0]
    far_lines = np.abs(lines.frequencies - tone.frequency) > REACH * _step(lines)
    return replace(
        lines,
        recording=replace(lines.recording, response=response),
        band=lines.band[far_lines],
        frequencies=lines.frequencies[far_lines],
        force_here=lines.force_here[far_lines],
        measured=lines.cut(response)[far_lines],
        trust=lines.trust[far_lines],
    )


def predicted_signal(fitted: Fit, lines: WindowedSpectrum) -> Real:
    """Return the predicted responses in time, (n_samples, n_responses)."""
    spectrum = predict_lines(fitted.hypothesis, lines).spectrum
    return np.asarray(scipy.fft.irfft(spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])


def _step(lines: WindowedSpectrum) -> float:
    return lines.recording.rate / len(lines.window)


def _whitened_power(fitted: Fit, lines: WindowedSpectrum, noise: NoiseModel) -> Real:
    """Return the power of each residual line over its noise, mean over channels."""
    residual = lines.measured - predict_lines(fitted.hypothesis, lines).response
    covariance = fitted_noise(lines, through_structure(fitted.hypothesis, lines), noise)
    return np.asarray(
        np.sum(np.abs(np.einsum("kij,kj->ki", whitening(covariance), residual)) ** 2, axis=1) / residual.shape[1]
    )


def sharp_contrast(power: Real) -> Real:
    """Return the contrast of each line of a power spectrum (n_lines,).

    It is the smaller of two ratios: to the median of the neighbourhood, and to the median of the close lines.
    """
    return np.minimum(above_neighbours(power, NEAR), above_neighbours(power, CLOSE))


def above_neighbours(power: Real, footprint: NDArray[np.bool_]) -> Real:
    """Return the ratio of each line of a power spectrum (n_lines,) to the median of the lines around it.

    ``footprint`` marks which of the lines around it are used.
    """
    # mirrored, as a repeated weak last line would give its neighbours contrast
    around = scipy.ndimage.median_filter(power, footprint=footprint, mode="mirror")
    return np.asarray(power / np.maximum(around, 1e-3 * power.mean() + 1e-300))


def _too_few_left(lines: list[WindowedSpectrum], frequency: float) -> bool:
    """Return whether less than three quarters of the lines of a recording remain without the tone."""
    reach = [np.abs(recording.frequencies - frequency) <= REACH * _step(recording) for recording in lines]
    return any(near.sum() > 0.25 * len(near) for near in reach)


def _at_a_sharp_resonance(fitted: Fit, lines: list[WindowedSpectrum], frequency: float) -> bool:
    """Return whether a mode near the frequency has a resonance that is hardly wider than a tone.

    A small error in the frequency of such a mode leaves an equally sharp line in the residual.
    """
    model = fitted.hypothesis.model
    step = max(_step(recording) for recording in lines)
    widths = 2 * model.damping_ratios * model.natural_frequencies
    near = np.abs(model.natural_frequencies - frequency) < np.maximum(widths, 3 * step)
    return bool((near & (widths < SHARP_LINES * step)).any())


def force_contrast(lines: WindowedSpectrum) -> Real:
    """Return the power of the forces at or near each line over the median of its neighbourhood, (n_lines,)."""
    power = np.sum(np.abs(lines.force_here / levels(lines)[1]) ** 2, axis=1)
    return np.asarray(scipy.ndimage.maximum_filter(above_neighbours(power, NEAR), 3))


def _amplitudes(fitted: Fit, lines: list[WindowedSpectrum], frequency: float) -> list[Real]:
    amplitudes = []
    for recording in lines:
        residual = recording.measured - predict_lines(fitted.hypothesis, recording).response
        k = int(np.argmin(np.abs(recording.frequencies - frequency)))
        power = np.sum(np.abs(residual[max(0, k - 2) : k + 3]) ** 2, axis=0)
        amplitudes.append(2 * np.sqrt(power / len(recording.window)))
    return amplitudes


MAX_RATE_SHARE = 0.45  # highest frequency that is searched, as a share of the sample rate


def tones_above_band(
    hypothesis: Hypothesis,
    lines: list[WindowedSpectrum],
    decay: float,
    most: int,
    settings: FaultSettings = FAULTS,
    clipped: Collection[str] = (),
) -> list[Tone]:
    """Return the tones above the compared band, strongest first; they appear in two recordings and in no force.

    No noise was fitted above the band, so that the contrast is the power of a residual line over the median of the
    neighbouring lines. The final hypothesis is used, as a hardening joint responds to periodic forces at further
    frequencies.

    ``decay``: decay rate of the slowest mode, 1/s.
    """
    above = [_above(recording, decay) for recording in lines]
    if not above or min(len(recording.frequencies) for recording in above) < 4 * len(NEAR):
        return []
    names = above[0].recording.channels[-above[0].measured.shape[1] :]
    channels = [k for k, name in enumerate(names) if name not in clipped]
    if not channels:
        return []
    residuals = [recording.measured - predict_lines(hypothesis, recording).response for recording in above]
    powers = [np.abs(residual[:, channels]) ** 2 for residual in residuals]
    contrasts = [np.mean([sharp_contrast(column) for column in power.T], axis=0) for power in powers]
    contrast = summed_contrast(contrasts, above, settings.quiet_force, settings)
    axis, tones = above[0].frequencies, list[Tone]()
    if is_comb(contrast, settings):
        return tones
    while len(tones) < most and contrast.max() > settings.contrast:
        k = int(np.argmax(contrast))
        tones.append(_tone(above, residuals, float(axis[k]), float(contrast[k])))
        contrast[max(0, k - REACH) : k + REACH + 1] = 0.0
    return tones


def _above(lines: WindowedSpectrum, decay: float) -> WindowedSpectrum:
    rate = lines.recording.rate
    band = float(lines.frequencies[-1]) + REACH / lines.recording.duration, MAX_RATE_SHARE * rate
    return windowed_spectrum(lines.recording, band, decay, first_motion=True)


def _tone(above: list[WindowedSpectrum], residuals: list[Complex], near: float, contrast: float) -> Tone:
    signals = [
        recording.recording.response[recording.start : recording.start + len(recording.window)]
        * recording.window[:, None]
        for recording in above
    ]
    frequency = sharp_frequency(signals, [recording.recording.rate for recording in above], near)
    sizes = []
    for recording, residual in zip(above, residuals, strict=True):
        k = int(np.argmin(np.abs(recording.frequencies - frequency)))
        power = np.sum(np.abs(residual[max(0, k - 2) : k + 3]) ** 2, axis=0)
        sizes.append(2 * np.sqrt(power / len(recording.window)))
    mean, spread = mean_and_error(sizes)
    return Tone(frequency, mean, 2 * contrast, spread)
