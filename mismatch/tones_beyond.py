"""Steady tones above the band in which model and recording are compared."""

import numpy as np
from numpy.typing import NDArray

from .explanation import Explanation, predict_lines
from .tones import (
    BESIDE,
    NEAR,
    REACH,
    SEEN_AGAIN,
    TONE_CONTRAST,
    Tone,
    above_neighbours,
    force_contrast,
    is_comb,
    sharp_frequency,
)
from .windowed_lines import WindowedLines, windowed_lines

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

HIGHEST = 0.45
"""Highest frequency looked at, as a share of the sample rate."""

QUIET_FORCE = 5.0
"""Contrast that no force may show there: above the modes a force's line needs no resonance to be seen in a response."""


def tones_beyond(explanation: Explanation, lines: list[WindowedLines], decay: float, most: int) -> list[Tone]:
    """Lines above the compared band that stand out of the residual in two recordings, and in no force.

    No noise was fitted there, so each response is its own measure: a line's power against the median of its neighbours.
    The explanation is the final one: a hardening joint answers periodic forces with lines that they do not have.

    Parameters
    ----------
    explanation
        With all causes.
    lines
        Recordings.
    decay
        Of the slowest mode, 1/s.
    most
        How many tones are looked for.

    Returns
    -------
    list of Tone
        Strongest first.
    """
    above = [_above(one, decay) for one in lines]
    if not above or min(len(one.frequencies) for one in above) < 4 * len(NEAR):
        return []
    axis = above[0].frequencies
    rests = [one.measured - predict_lines(explanation, one).response for one in above]
    contrasts = [_contrast(rest) for rest in rests]
    nearest = [np.searchsorted(one.frequencies, axis).clip(1, len(one.frequencies) - 2) for one in above]
    shown = np.array(
        [np.max([c[at + shift] for shift in (-1, 0, 1)], axis=0) for c, at in zip(contrasts, nearest, strict=True)]
    )
    again = np.sort(shown, axis=0)[-min(2, len(shown))]
    pushed = [np.interp(axis, one.frequencies, force_contrast(one)) > QUIET_FORCE for one in above]
    together = np.where((again > SEEN_AGAIN) & ~np.any(pushed, axis=0), shown.sum(axis=0), 0.0)
    found: list[Tone] = []
    if is_comb(together):
        return found
    while len(found) < most and together.max() > TONE_CONTRAST:
        k = int(np.argmax(together))
        found.append(_tone(above, rests, float(axis[k]), float(together[k])))
        together[max(0, k - REACH) : k + REACH + 1] = 0.0
    return found


def _above(lines: WindowedLines, decay: float) -> WindowedLines:
    rate = lines.trial.rate
    return windowed_lines(
        lines.trial, (float(lines.frequencies[-1]) + REACH / lines.trial.duration, HIGHEST * rate), decay
    )


def _contrast(rest: Complex) -> Real:
    power = np.abs(rest) ** 2
    each = [np.minimum(above_neighbours(column, NEAR), above_neighbours(column, BESIDE)) for column in power.T]
    return np.asarray(np.mean(each, axis=0))


def _tone(above: list[WindowedLines], rests: list[Complex], near: float, contrast: float) -> Tone:
    kept = [one.trial.response[one.start : one.start + len(one.window)] * one.window[:, None] for one in above]
    frequency = sharp_frequency(kept, [one.trial.rate for one in above], near)
    sizes = []
    for one, rest in zip(above, rests, strict=True):
        k = int(np.argmin(np.abs(one.frequencies - frequency)))
        power = np.sum(np.abs(rest[max(0, k - 2) : k + 3]) ** 2, axis=0)
        sizes.append(2 * np.sqrt(power / len(one.window)))
    return Tone(frequency, np.asarray(np.mean(sizes, axis=0)), 2 * contrast)
