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
    frequency : Hz
        Frequency of the tone.
    share
        Root mean square of the tone over that of the motion, in the channel where it is largest.
    name
        Words for the tone's source, for example ``mains (3 x 50 Hz)``.
    """

    frequency: float
    share: float
    name: str


@dataclass(frozen=True)
class ChatterVerdict:
    """Verdict on a recording of a cut: stable or chattering, and why.

    Parameters
    ----------
    kind
        ``stable``, ``hopf``, ``period-doubling`` or ``inconclusive``.
    deviation
        Size of what does not repeat with the revolution over the size of the motion, in the second half: noise too.
    growth
        Size of the strongest line that is not foreign in the last eighth over that in the first; NaN without such a
        line.
    frequency : Hz
        Frequency of the line with the largest motion, not folded; NaN if the cut does not chatter.
    p_value
        Probability that the recording's own noise has a line as strong as the strongest that is not foreign; 1 if
        there is none.
    share
        Root mean square of the lines of chatter over that of the motion, in the channel where it is largest.
    foreign
        Tones that are neither the spindle's nor chatter.
    spindle_speed : rad/s
        Spindle speed found from the recording.
    drift
        Change of the spindle's speed from beginning to end, over its mean.
    reason
        One sentence that says why the verdict is as it is.
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
