"""Whether modes move with the level though nothing that is told moves them: the answer is then not whole."""

from collections.abc import Sequence
from dataclasses import replace

from ...behaviour import Behaviour
from ...inference import AcceptedCause, Improvement, VerdictSettings, error_halved
from ...models import Hypothesis

LIMITS = frozenset(("clipping",))
"""Faults of a recording that depend on the level, too."""


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
