"""The step from the lines of a recording to a verdict: chatter first, then what looks like it, then stability."""

import math
from dataclasses import replace

import numpy as np

from .alternating import SILENT, of_alternation
from .knowledge import Knowledge
from .motion import Evidence, ToolMotion, irregular_change, largest_motion
from .sorting import UNMODULATED, Sorted, sort_families
from .suspects import cannot_be_noise, of_suspect
from .verdict import CHATTER, DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict

HIDDEN = 0.15
"""Share of the motion that a line could have and not stand out of the noise, from which nothing is concluded."""
IRREGULAR = 0.5
"""Share of the motion that does not repeat from which a recording is not called stable."""
WILD = 0.5
"""Change of the chip by what neither repeats nor is a line, from which it is chatter."""
WILD_SHARE = 0.4
"""Share of the motion that it must be."""


def concluded(evidence: Evidence, known: Knowledge) -> ChatterVerdict:
    """The verdict, without the spindle's speed."""
    found = sort_families(evidence)
    verdict = ChatterVerdict(STABLE, evidence.deviation, math.nan, math.nan, foreign=found.foreign)
    lines = _of_lines(evidence, found, known, verdict)
    if lines.kind in CHATTER:
        return lines
    alternating = of_alternation(evidence, known, verdict if lines.kind == INCONCLUSIVE else lines)
    if alternating.kind == DOUBLING:
        return alternating
    wild = _of_wild_motion(evidence, found, known.motion, verdict)
    for told in (wild, lines, alternating):
        if told.kind != STABLE:
            return told
    return _of_quiet(evidence, found, alternating)


def _of_lines(evidence: Evidence, found: Sorted, known: Knowledge, verdict: ChatterVerdict) -> ChatterVerdict:
    """The verdict on the largest lines that may be chatter, or on others that change the chip more than noise can."""
    first, motion = verdict, known.motion
    for number, family in enumerate(found.suspects):
        if number and not (motion and cannot_be_noise(family, evidence, motion.of_family(family))):
            continue
        told = of_suspect(family, evidence, known, verdict)
        if told.kind in CHATTER:
            line = largest_motion(family.lines, known.derivatives, known.natural)
            named = tuple(tone for tone in found.foreign if tone.name != UNMODULATED)  # others may be chatter's own
            return replace(told, frequency=line.frequency, foreign=named)
        first = first if number else told
    return first


def _of_wild_motion(
    evidence: Evidence, found: Sorted, motion: ToolMotion | None, verdict: ChatterVerdict
) -> ChatterVerdict:
    """Irregular chatter: neither repeats nor has lines that stay."""
    if motion is None or evidence.deviation < WILD_SHARE:
        return verdict
    single = [family.lines[0].frequency for family in found.suspects if len(family.lines) == 1]
    tones = np.array([tone.frequency for tone in found.foreign] + single) / evidence.track.mean_frequency
    change = irregular_change(evidence.spectrum, motion, tones)
    if change < WILD:
        return verdict
    orders = evidence.spectrum.orders
    strongest = int(np.argmax(np.where(evidence.spectrum.searched, evidence.spectrum.power.sum(axis=1), 0.0)))
    reason = (
        f"{100 * evidence.deviation:.0f} % of the motion does not repeat, and changes the chip by {100 * change:.0f} %"
    )
    frequency = float(orders[strongest] * evidence.track.mean_frequency)
    return replace(verdict, kind=HOPF, frequency=frequency, p_value=evidence.spectrum.p_values.min(), reason=reason)


def _of_quiet(evidence: Evidence, found: Sorted, verdict: ChatterVerdict) -> ChatterVerdict:
    """Whether a recording in which no chatter was found could have shown any."""
    if evidence.order_p_value > SILENT:
        reason = (
            "no order of the spindle stands out of the noise within 1.2 % of the stated speed: is the tool in the "
            "cut, and the speed right?"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    if evidence.least_share > HIDDEN:
        reason = (
            f"noise hides lines of up to {100 * evidence.least_share:.0f} % of the motion; record longer, or place "
            "the sensor nearer to the tool"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    unexplained = math.sqrt(max(evidence.deviation**2 - sum(tone.share**2 for tone in found.foreign), 0.0))
    if unexplained > IRREGULAR:
        reason = (
            f"{100 * unexplained:.0f} % of the motion does not repeat and is no clear line: noise, a changing cut or "
            "irregular chatter"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    return replace(verdict, reason=verdict.reason or "what does not repeat is noise or foreign")
