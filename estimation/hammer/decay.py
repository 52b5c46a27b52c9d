"""How much of the answer to a tap is left at the segment's end, and the exponential window that takes it away."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from .segments import TapSettings
from .tap_spectra import LateAnswers, late_answers
from .taps import FoundTaps

DIED_OUT = 0.003
"""Share of an answer that may be cut off: it is the relative error of an FRF at its resonances."""

WINDOWED = 0.0003
"""Share that an exponential window, once there is one, leaves of an answer at the segment's end."""

STRONG = 1e-5
"""Power over the largest power of a response from which a line is looked at: 50 dB."""

DRIVEN = 1e-2
"""Power over the largest power of the force within which a tap drives: 20 dB."""

_FALSE = 1e-6  # chance that noise alone makes a line stand out of its neighbours
_CHANCE, _FOLLOWS = 1e-4, 0.9  # of a coherence that noise or hum reaches; and coherence that is enough
_FALLS = 0.87  # power of the last half over that of the middle, for the least damping below
_MORE = 4.0  # power over that before the first tap, where hum is already, and over that of the lines around
_AROUND = 41  # lines
_LEAST_DAMPING = 0.3  # of sigma T: where noise hides the decay, or there is hardly any
_LOWEST = 4  # lines: below them the window's main lobe holds what is left of the level


@dataclass(frozen=True)
class Decay:
    """The mode that rings longest in the segments of a tap.

    Parameters
    ----------
    left
        Amplitude of that mode at the segment's end, as a share of its amplitude at the beginning.
    frequency : Hz
        Frequency of that mode.
    response
        Degree of freedom of the response in which it was seen.
    before
        Share of the response to the tap before that still rings when a tap comes, where it is largest; 0: not seen.
    """

    left: float
    frequency: float
    response: str
    before: float


def answer_decay(found: Sequence[FoundTaps], settings: TapSettings) -> Decay:
    """Say how much of the slowest mode's answer the segment's end cuts off, over the FRF at its resonance.

    A mode that rings late stands alone by then: under one Hann window its power falls from the middle half of the
    segment to the last half by ``exp(-2 sigma T/4)``, which tells its damping sigma. Its amplitude A at the segment's
    end follows, and what is cut off, ``A / sigma``, is compared with the answer's whole spectrum on that line; of one
    mode alone the share is ``exp(-sigma T)``. Lines count that stand out of their neighbours in the last half, since a
    mode that still rings there is narrower than a few lines, and noise is not; hum, which does not answer the taps,
    does not count.

    Parameters
    ----------
    found
        Usable taps of all tests.
    settings
        Segments; their exponential window is not applied.
    """
    decays = [_decay(answers, settings) for answers in late_answers(found, settings)]
    longest = max(decays, key=lambda one: one.left)
    return replace(longest, before=max(one.before for one in decays))


def window_for(left: float, settings: TapSettings) -> float | None:
    """Time constant (s) with which ``left`` falls to ``WINDOWED`` at the segment's end; None where none is needed.

    Examples
    --------
    >>> settings = TapSettings(1000.0, 2000, 20, 60)
    >>> window_for(0.001, settings), round(window_for(0.3, settings), 4)
    (None, 0.2895)
    """
    return None if left <= DIED_OUT else float(settings.duration / np.log(left / WINDOWED))


def _decay(answers: LateAnswers, settings: TapSettings) -> Decay:
    rings = _rings(answers)
    if not rings.any():
        return Decay(0.0, 0.0, "", 0.0)
    last = np.sqrt(answers.last)
    # of the whole segment's lines, every second is one of a half's; a resonance may lie between
    whole = np.sqrt(scipy.ndimage.maximum_filter1d(answers.whole, 3, axis=0)[::2][: len(last)])
    lost = np.log(np.divide(answers.middle, answers.last, out=np.ones_like(whole), where=rings & (answers.middle > 0)))
    damping = np.clip(2 * lost, _LEAST_DAMPING, None)  # sigma T
    tail = 4 / damping * np.exp(-damping / 4)
    cut = np.where(rings, last * tail, 0.0)
    left = cut / np.where(rings, cut + whole, 1.0)
    heard = rings & _stands_out(answers.earlier, answers.n_earlier)
    before = np.where(heard, np.sqrt(answers.earlier) * tail * -np.expm1(-damping), 0.0) / np.where(rings, whole, 1.0)
    line, column = np.unravel_index(int(np.argmax(left)), left.shape)
    return Decay(
        float(left[line, column]),
        float(line * settings.sample_rate / (settings.length // 2)),
        answers.places[int(column)],
        min(1.0, float(before.max())),
    )


def _rings(answers: LateAnswers) -> NDArray[np.bool_]:
    """Lines and responses at which a mode still rings in the last half of the segments."""
    last, driven = answers.last, answers.force > DRIVEN * answers.force.max()
    driven[:_LOWEST] = False
    tops = np.zeros(last.shape, dtype=bool)
    tops[1:-1] = (last[1:-1] >= last[:-2]) & (last[1:-1] >= last[2:])
    strong = answers.whole[::2][: len(last)] > STRONG * answers.whole.max(axis=0)
    new = last > _MORE * answers.rest
    return np.asarray(tops & driven[:, None] & strong & new & _answers(answers) & _stands_out(last, answers.n_taps))


def _answers(answers: LateAnswers) -> NDArray[np.bool_]:
    """Say on which lines the late signal is a response to the taps and no hum.

    It follows the force from tap to tap, or it falls, or it was not there before the first tap. A single tap in a
    recording without a quiet time before it does not tell the two apart.
    """
    if answers.quiet_known or answers.n_taps == 1:
        return np.ones(answers.last.shape, dtype=bool)
    by_chance = 1 - _CHANCE ** (1 / (answers.n_taps - 1))  # exceeded by noise of n averages with this probability
    return np.asarray((answers.coherence > min(by_chance, _FOLLOWS)) | (answers.last < _FALLS * answers.middle))


def _stands_out(power: Real, n_taps: int) -> NDArray[np.bool_]:
    """Say where a power exceeds that of the lines around by more than noise does on one line of a million."""
    if not n_taps:
        return np.zeros(power.shape, dtype=bool)
    around = scipy.ndimage.median_filter(power, size=(min(_AROUND, len(power)), 1), mode="nearest")
    return np.asarray(
        power > max(_MORE, scipy.stats.chi2.isf(_FALSE, 2 * n_taps) / scipy.stats.chi2.median(2 * n_taps)) * around
    )
