"""From what was found to a verdict that binds: what an answer may leave, and what held-out data must confirm."""

from dataclasses import dataclass

from .diagnosis import Improvement
from .remainder import Remainder
from .settings import VerdictSettings


@dataclass(frozen=True)
class Findings:
    """What a verdict is made of.

    Parameters
    ----------
    before, after
        What is left without any cause, and with the causes.
    named
        Whether causes were found that the held-out data confirm.
    excluded
        Whether something rules out every answer: a law beyond what its name means, a recording that chatters.
    incomplete
        Whether the held-out data show that the answer leaves more than it may.
    halved
        Whether the causes remove the share of the held-out error that a partial answer needs.
    """

    before: Remainder
    after: Remainder
    named: bool
    excluded: bool = False
    incomplete: bool = False
    halved: bool = True


def verdict_of(found: Findings, settings: VerdictSettings) -> str:
    """The verdict: ``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Parameters
    ----------
    found
        What is left, and what the held-out data say.
    settings
        Thresholds of what an answer may leave.

    Examples
    --------
    >>> left = Remainder(0.3, 1.0), Remainder(0.01, 0.02)
    >>> verdict_of(Findings(*left, named=True), VerdictSettings())
    'explained'
    >>> verdict_of(Findings(left[0], left[0], named=False), VerdictSettings())
    'unexplained'
    """
    if found.excluded:
        return "unexplained"
    if not found.named:
        complete = found.before.noise_like(settings.noise_like) and not found.incomplete
        return "none" if complete else "unexplained"
    quiet = found.after.noise_like(settings.noise_like)
    little = quiet or found.after.size <= (1 - settings.explained) * found.before.size
    if little and not found.incomplete:
        return "explained"
    less = little or found.after.size <= (1 - settings.partly) * found.before.size
    return "partly explained" if less and found.halved else "unexplained"


def leaves_too_much(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether an answer leaves more of the held-out recording than it may.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of what an answer may leave.
    """
    if gain.after > settings.most_of_response:
        return True
    return gain.after > settings.most_over_noise * gain.noise_floor and share_left(gain) > settings.most_left


def error_halved(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether an answer leaves so little of what its rival leaves above the noise that it may be told in part.

    An answer that errs by as much as the response itself predicts nothing, whatever its rival does.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of what an answer may leave.

    Examples
    --------
    >>> error_halved(Improvement("mid", 0.9, 0.5, 0.2, 0.1, 0.01, (0.1, 0.3)), VerdictSettings())
    True
    >>> error_halved(Improvement("mid", 0.9, 0.5, 0.3, 0.1, 0.01, (0.1, 0.3)), VerdictSettings())
    False
    """
    rival = gain.refitted if gain.against == "refitted" else gain.before
    excess, left = (max(one**2 - gain.noise_floor**2, 0.0) for one in (rival, gain.after))
    return gain.after < 1 and excess > 0 and left <= settings.halves * excess


def share_left(gain: Improvement) -> float:
    """Share of the nominal model's power above the noise, on the held-out recording, that the answer leaves.

    The share is 0 where nothing is left, and more than 1 where the answer is worse than the nominal model.

    Parameters
    ----------
    gain
        Errors on the recording held out.

    Examples
    --------
    >>> share_left(Improvement("mid", 0.5, 0.4, 0.1, 0.1, 0.01, (0.1, 0.3)))
    0.0
    """
    excess = gain.before**2 - gain.noise_floor**2
    left = max(gain.after**2 - gain.noise_floor**2, 0.0)
    return left / excess if excess > 0 else float(left > 0)
