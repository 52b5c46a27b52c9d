"""From what is found in a recording to a verdict: chatter first, then what only looks like it, then stability."""

import math
from dataclasses import replace

from .course import Course, course_of
from .evidence import Evidence
from .families import TOLERANCE, Family, largest_motion
from .sorting import UNMODULATED, Sorted, sort_families
from .teeth import alternation, alternation_course
from .verdict import DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict

LARGE = 0.2
"""Share of the motion from which lines that the teeth modulate are chatter even where they are not sharp."""
LEAST = 0.05
"""Share of the motion from which sharp and steady lines are a limit cycle."""
STEADY = 0.45
"""Standard deviation of a line's power over its mean up to which it is a limit cycle."""
HUGE = 0.5
"""Share of the motion from which they are chatter even where their size fluctuates."""
FLUCTUATING = 0.6
"""Standard deviation of a line's power over its mean from which it is noise rather than a limit cycle."""
ALTERNATING = 0.5
"""Size of the motion that alternates from tooth to tooth, over that which does not, from which teeth said to be equal
double their period."""
OVERLOOKED = 0.05
"""Size of that motion below which it is not told."""
HIDDEN = 0.15
"""Share of the motion that a line could have and not stand out of the noise, from which nothing is concluded."""
NEAR_A_MODE = 0.2
"""Relative distance from a natural frequency within which a large line is the structure's, side lines or not."""
IRREGULAR = 0.5
"""Share of the motion that does not repeat from which a recording is not called stable."""
_PAIR = 2  # teeth of which an eccentric spindle makes one cut more and one less, turn by turn
_SILENT = 1e-3  # p-value of the orders above which they do not stand out


def concluded(
    evidence: Evidence, runout: bool, derivatives: tuple[int, ...], natural: tuple[float, ...]
) -> ChatterVerdict:
    """The verdict, without the spindle's speed; parameters as those of :func:`classify_cut`."""
    found = sort_families(evidence)
    verdict = ChatterVerdict(STABLE, evidence.deviation, math.nan, math.nan, foreign=found.foreign)
    if found.suspects:
        verdict = _of_suspect(found.suspects[0], evidence, natural, verdict)
        if verdict.kind in (HOPF, DOUBLING):
            line = largest_motion(found.suspects[0].lines, derivatives, natural)
            named = tuple(tone for tone in found.foreign if tone.name != UNMODULATED)  # others may be chatter's own
            return replace(verdict, frequency=line.frequency, foreign=named)
        if verdict.kind == INCONCLUSIVE:
            return verdict
    verdict = _of_alternation(evidence, runout, verdict)
    return verdict if verdict.kind != STABLE else _of_quiet(evidence, found, verdict)


def _of_suspect(
    family: Family, evidence: Evidence, natural: tuple[float, ...], verdict: ChatterVerdict
) -> ChatterVerdict:
    """Whether lines that may be chatter are."""
    course = course_of(evidence.revolutions, family.lines[0].order)
    verdict = replace(verdict, growth=course.growth, p_value=family.p_value, share=family.share)
    at = f"the line at {family.lines[0].frequency:.2f} Hz ({100 * family.share:.0f} % of the motion)"
    if course.dies_out:
        reason = f"{at} dies out: its last eighth is {course.growth:.2g} times the first"
        return replace(verdict, kind=STABLE, reason=reason)
    near = min((abs(family.lines[0].frequency / mode - 1) for mode in natural), default=math.inf) < NEAR_A_MODE
    if len(family.lines) == 1 and not course.grows and not near:
        reason = (
            f"{at} has no side lines at the tooth passing, as a foreign tone has none, but is as large as chatter; "
            "record the machine without cutting and see whether it is still there"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    doubt = _doubt(family, course)
    if doubt:
        return replace(verdict, kind=INCONCLUSIVE, reason=f"{at} {doubt}")
    teeth = evidence.revolutions.teeth
    doubled = abs(family.place - teeth / 2) < TOLERANCE * evidence.spectrum.resolution
    sides = (
        f"has {len(family.lines) - 1} side lines at the tooth passing" if len(family.lines) > 1 else "is near a mode"
    )
    reason = f"{at} {sides}" + (" and grows" if course.grows else " and does not die out")
    return replace(verdict, kind=DOUBLING if doubled else HOPF, reason=reason)


def _doubt(family: Family, course: Course) -> str:
    """Why lines with side lines may not be chatter; empty where they are."""
    limit_cycle = family.sharp and course.steadiness < STEADY and family.share > LEAST
    if course.grows or limit_cycle:
        return ""
    if family.share < LARGE:
        return (
            f"has side lines at the tooth passing but stays below {100 * LARGE:.0f} %: chatter that begins, noise "
            "through a lightly damped mode, or a foreign tone that the teeth modulate; record longer, or cut deeper"
        )
    if course.steadiness > FLUCTUATING and family.share < HUGE:
        return "fluctuates as noise does through a lightly damped mode; record longer, or cut deeper"
    return ""


def _of_alternation(evidence: Evidence, runout: bool, verdict: ChatterVerdict) -> ChatterVerdict:
    """Period doubling of an even number of teeth, whose lines are orders of the spindle."""
    size = alternation(evidence.late)
    if not size > OVERLOOKED or evidence.alternation_p_value > _SILENT:
        return verdict
    course = alternation_course(evidence.revolutions)
    frequency = 0.5 * evidence.revolutions.teeth * evidence.track.mean_frequency
    told = f"the motion that alternates from tooth to tooth is {size:.2g} times that which does not"
    doubled = replace(
        verdict, kind=DOUBLING, growth=course.growth, p_value=evidence.alternation_p_value, frequency=frequency
    )
    if course.grows:
        return replace(doubled, reason=f"{told}, and grows")
    if not runout and size > ALTERNATING:
        warning = f"{told}; runout, which the cutting file does not state, would look the same"
        return replace(doubled, reason=told, warnings=(warning,))
    if runout and size < ALTERNATING and evidence.revolutions.teeth == _PAIR:
        return replace(verdict, warnings=(f"{told}; it is taken for runout",))
    reason = (
        f"{told}: period doubling, or runout that shakes the structure at {frequency:.2f} Hz; "
        "record the entry, or cut at half the depth: runout shakes less there, chatter vanishes"
    )
    return replace(doubled, kind=INCONCLUSIVE, frequency=math.nan, reason=reason)


def _of_quiet(evidence: Evidence, found: Sorted, verdict: ChatterVerdict) -> ChatterVerdict:
    """Whether a recording in which no chatter was found could have shown any."""
    if evidence.order_p_value > _SILENT:
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
