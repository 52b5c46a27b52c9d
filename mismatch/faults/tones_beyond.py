"""Steady tones above the band in which model and recording are compared."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum, windowed_spectrum

from ..inference import FAULTS, FaultSettings
from ..models import Hypothesis, predict_lines
from .tones import (
    NEAR,
    REACH,
    Tone,
    is_comb,
    mean_and_error,
    seen_together,
    sharp_contrast,
    sharp_frequency,
)

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

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
