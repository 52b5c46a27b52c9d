"""`ChatterVerdict`: what a recording says about the stability of its cut."""

from dataclasses import dataclass

STABLE = "stable"
HOPF = "hopf"
DOUBLING = "period-doubling"
INCONCLUSIVE = "inconclusive"
CHATTER = (HOPF, DOUBLING)


@dataclass(frozen=True)
class ForeignTone:
    """A line that is neither an order of the spindle nor chatter.

    Parameters
    ----------
    frequency
        Of the line, Hz.
    share
        Root mean square over the motion's, in the channel where it is largest.
    name
        What it is, for example ``mains (3 x 50 Hz)``.
    """

    frequency: float
    share: float
    name: str


@dataclass(frozen=True)
class ChatterVerdict:
    """What a recording of a cut says.

    Parameters
    ----------
    kind
        ``stable``, ``hopf``, ``period-doubling`` or ``inconclusive``.
    deviation
        Size of what does not repeat with the revolution over the size of the motion, in the second half: noise too.
    growth
        Size of the strongest line that is not foreign in the last eighth over that in the first; NaN without such a
        line.
    frequency
        Of the line with the largest motion, Hz, not folded; NaN if the cut does not chatter.
    p_value
        Probability that the recording's own noise has a line as strong as the strongest that is not foreign; 1 if
        there is none.
    share
        Root mean square of the lines of chatter over that of the motion, in the channel where it is largest.
    foreign
        Tones that are neither the spindle's nor chatter.
    spindle_speed
        Found from the recording, rad/s.
    drift
        Change of the spindle's speed from begin to end over its mean.
    reason
        One sentence.
    warnings
        Doubts, one sentence each.
    """

    kind: str
    deviation: float
    growth: float
    frequency: float
    p_value: float = 1.0
    share: float = 0.0
    foreign: tuple[ForeignTone, ...] = ()
    spindle_speed: float = float("nan")
    drift: float = 0.0
    reason: str = ""
    warnings: tuple[str, ...] = ()
