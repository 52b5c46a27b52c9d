"""Motion that alternates from tooth to tooth: period doubling of an even number of teeth, or runout."""

import math
from dataclasses import replace

from .knowledge import Knowledge
from .motion import Evidence, alternating_change, alternation, alternation_course
from .told_by_model import told_by_model
from .verdict import DOUBLING, INCONCLUSIVE, ChatterVerdict

ALTERNATING = 0.5
"""Size of the motion that alternates over that which does not, below which two teeth are taken for eccentric, and above
which a cutter of unstated runout doubles its period."""
OVERLOOKED = 0.05
"""Size of that motion below which it is not told."""
OUT_OF_THE_CUT = 0.5
"""Change of the chip from tooth to tooth, over the thickest, that takes teeth out of the cut."""
AMPLIFIED = (8.0, 1.5)
"""That change over twice the stated runout from which it is no runout that a mode amplifies: two teeth, more teeth. An
eccentric spindle is a force at half the tooth passing with two teeth alone (two of 300 stable cuts
amplified it more); with more it has the orders beside the tooth passing."""
SILENT = 1e-3
"""p-value above which orders do not stand out of the noise."""
_PAIR = 2  # teeth of which an eccentric spindle makes one cut more and one less, turn by turn


def of_alternation(evidence: Evidence, known: Knowledge, verdict: ChatterVerdict) -> ChatterVerdict:
    """Give the verdict on motion that alternates from tooth to tooth, whose lines are orders of the spindle.

    Parameters
    ----------
    evidence
        Evidence gathered from the recording.
    known
        What is known of the cut; runout, chip and, where there is one, model decide.
    verdict
        Verdict so far; it is returned as it is where nothing alternates.
    """
    runout, motion = known.runout, known.motion
    size = alternation(evidence.late)
    if not size > OVERLOOKED or evidence.alternation_p_value > SILENT:
        return verdict
    teeth = evidence.revolutions.teeth
    course = alternation_course(evidence.revolutions)
    frequency = 0.5 * teeth * evidence.track.mean_frequency
    told = f"the motion that alternates from tooth to tooth is {size:.2g} times that which does not"
    doubled = replace(
        verdict, kind=DOUBLING, growth=course.growth, p_value=evidence.alternation_p_value, frequency=frequency
    )
    if course.grows:
        return replace(doubled, reason=f"{told}, and grows")
    if runout == 0 or (math.isnan(runout) and size > ALTERNATING):
        stated = "is stated as zero" if runout == 0 else "the cutting file does not state"
        warning = f"{told}; runout, which {stated}, would look the same"
        return replace(doubled, reason=told, warnings=(warning,))
    change, eccentric = 0.0, math.inf
    if motion is not None:
        change, eccentric = alternating_change(evidence.late, evidence.spectrum, motion), 2 * runout / motion.chip
    out = change > OUT_OF_THE_CUT
    if out and change > AMPLIFIED[teeth != _PAIR] * eccentric:
        reason = f"the chip alternates from tooth to tooth by {100 * change:.0f} % of the thickest"
        warning = f"{reason}; inserts that stand out by more than the stated runout would look the same"
        return replace(doubled, reason=reason, warnings=(warning,))
    by_model = told_by_model(evidence, known.modelled, known.derivatives, doubled) if known.modelled else None
    if by_model is not None:
        return by_model
    if not out and size < ALTERNATING and teeth == _PAIR and not math.isnan(runout):
        return replace(verdict, warnings=(f"{told}; it is taken for runout",))
    reason = (
        f"{told}: period doubling, or runout that shakes the structure at {frequency:.2f} Hz; "
        "record the entry, or cut at half the depth: runout shakes less there, chatter vanishes"
    )
    return replace(doubled, kind=INCONCLUSIVE, frequency=math.nan, reason=reason)
