"""From what was found to a verdict that binds: what an answer may leave, and what a held-out recording must confirm."""

from ..adapters.structure.acceptance import unexplained
from ..models.fitting import Fit
from ..remainder.leftover import Leftover
from .diagnosis import AcceptedCause, Improvement

MOST_OF_RESPONSE = 0.25
"""Error on the held-out recording, as a share of the response, above which no answer is complete: so much may be noise,
and nothing shows that it is."""

MOST_OVER_NOISE = 1.5
"""Error on the held-out recording over the noise above which something may be missing still."""

MOST_LEFT = 0.1
"""Share of the nominal model's power above the noise that the answer may then leave."""

CONFIRMED = 0.05
"""p-value on the held-out recording above which a cause is not told."""


def verdict_of(final: Fit, accepted: list[AcceptedCause], left: Leftover, before: Leftover, gain: Improvement) -> str:
    """``none``, ``explained``, ``partly explained`` or ``unexplained``.

    Parameters
    ----------
    final
        Of all that was accepted.
    accepted
        Causes.
    left, before
        What moves with the signal under ``final``, and without any cause.
    gain
        On the recording held out.
    """
    if unexplained(final.explanation, left, before):
        return "unexplained"
    if not accepted:
        return "unexplained" if gain.after > MOST_OF_RESPONSE and gain.before > MOST_OF_RESPONSE else "none"
    return "partly explained" if leaves_too_much(gain) else "explained"


def leaves_too_much(gain: Improvement) -> bool:
    """Whether an answer leaves more of the held-out recording than it may."""
    if gain.after > MOST_OF_RESPONSE:
        return True
    return gain.after > MOST_OVER_NOISE * gain.noise_floor and share_left(gain) > MOST_LEFT


def share_left(gain: Improvement) -> float:
    """Of the nominal model's power above the noise on the held-out recording, what the answer leaves; 0 to 1 or more.

    Examples
    --------
    >>> share_left(Improvement("mid", 0.5, 0.4, 0.1, 0.1, 0.01, (0.1, 0.3)))
    0.0
    """
    excess = gain.before**2 - gain.noise_floor**2
    left = max(gain.after**2 - gain.noise_floor**2, 0.0)
    return left / excess if excess > 0 else float(left > 0)
