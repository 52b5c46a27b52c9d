"""Whether modes move with the level though nothing that is told moves them: the answer is then not whole."""

from collections.abc import Sequence
from dataclasses import replace

from estimation import WindowedSpectrum

from ...behaviour import FOLLOWS_LEVEL, Behaviour, behaviour_of
from ...inference import AcceptedCause, Improvement, VerdictSettings, error_halved
from ...models import Hypothesis

LIMITS = frozenset(("clipping",))
"""Faults of a recording that depend on the level, too."""

SEEN_TO_STAY = 3.0
"""Standard errors, beside the causes, from which a mode's move without them would show again."""


def moved_by_level(answer: Hypothesis, causes: Sequence[AcceptedCause], behaviour: Behaviour | None) -> str:
    """How modes move with the level, in words, where nothing that would be told depends on it; else nothing.

    Every recording was refitted alone by a linear model, so the evidence needs no law and no library.

    Parameters
    ----------
    answer
        The hypothesis that would be told.
    causes
        Causes that would be told, faults among them.
    behaviour
        What modes do with the level; None: not looked at.
    """
    if behaviour is None or not behaviour.follows_level:
        return ""
    if answer.laws or any(one.name in LIMITS for one in causes):
        return ""
    return f"{behaviour.sentence} No linear model does that, so the answer is not whole"


def stay_beside(answer: Hypothesis, behaviour: Behaviour | None, recordings: Sequence[WindowedSpectrum]) -> bool:
    """Whether modes that move without the causes are seen to stay with them.

    A rotor's coupling or a further mode that is missing shifts the modes of a refit, too, as far as levels differ in
    their speeds and spectra.

    Parameters
    ----------
    answer
        The hypothesis that would be told, with linear causes alone.
    behaviour
        What modes do without any cause; None: not looked at.
    recordings
        Windowed spectra of the recordings.
    """
    return behaviour is not None and seen_to_stay(behaviour, behaviour_of(answer, recordings))


def seen_to_stay(before: Behaviour, after: Behaviour) -> bool:
    """Whether no mode moves in the second behaviour, and each that moves in the first would show that there.

    Parameters
    ----------
    before, after
        What modes do with the level, without causes and with them.
    """
    if after.follows_level or len(after.modes) < len(before.modes):
        return False
    for moved, again in zip(before.modes, after.modes, strict=False):
        if moved.family not in FOLLOWS_LEVEL:
            continue
        frequency = moved.p_values[0] <= moved.p_values[1]
        change, error = (moved.shift, again.shift_error) if frequency else (moved.gain, again.gain_error)
        if SEEN_TO_STAY * error > abs(change):
            return False
    return True


def stands_beside_moving_modes(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether linear causes leave a quarter, at most, of the power that a plain refit leaves above the noise.

    Where modes move with the level a linear cause that gains little may only mend what the law that is missing does.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of the verdict.

    Examples
    --------
    >>> little = Improvement("mid", 0.18, 0.0362, 0.0361, 0.0352, 0.0003, (0.1, 0.3))
    >>> stands_beside_moving_modes(little, VerdictSettings())
    False
    """
    return error_halved(replace(gain, against="refitted"), settings)
