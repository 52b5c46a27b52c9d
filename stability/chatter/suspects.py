"""Whether lines that may be chatter are: how large they are, how steady, and what they do to the chip."""

import math
from dataclasses import replace

from .knowledge import Knowledge
from .motion import SHARP, TOLERANCE, Course, Evidence, Family, course_of, envelope_of
from .sorting import mains_of
from .verdict import DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict

LARGE = 0.2
"""Share of the motion from which lines that the teeth modulate are chatter even where they are not sharp."""
LEAST = 0.05
"""Share of the motion from which sharp and steady lines are a limit cycle, and change of the chip below which lines
that are not are noise."""
STEADY = 0.45
"""Standard deviation of a line's power over its mean up to which it is a limit cycle."""
HUGE = 0.5
"""Share of the motion from which lines are chatter even where their size fluctuates."""
FLUCTUATING = 0.6
"""Standard deviation of a line's power over its mean from which it is noise rather than a limit cycle."""
NEAR_A_MODE = 0.2
"""Relative distance from a natural frequency within which a large line is the structure's, side lines or not."""
FORMS = ((0.1, 0.95, 0.4), (0.05, 0.6, 0.6))
"""Least change of the chip, largest fluctuation and least coherence of a vibration that cannot be a stable cut's own
noise: the smaller it is, the steadier it must be. Cutting forces that vary by 3 % from pass to pass change the chip by
less than a tenth in nearly all stable cuts, and fluctuate by 1."""
SHAKEN = 0.2
"""Change of the chip by one line with more than half of the motion from which it is chatter without side lines."""


def of_suspect(
    family: Family,
    evidence: Evidence,
    known: Knowledge,
    verdict: ChatterVerdict,
) -> ChatterVerdict:
    """Decide whether lines that may be chatter are chatter.

    Parameters
    ----------
    family
        Family of lines that is judged.
    evidence
        Evidence gathered from the recording.
    known
        What is known of the cut; modes and chip decide.
    verdict
        Verdict so far, which is completed with what is found of the lines.
    """
    motion = known.motion
    course = course_of(evidence.revolutions, family.lines[0].order)
    verdict = replace(verdict, growth=course.growth, p_value=family.p_value, share=family.share)
    at = f"the line at {family.lines[0].frequency:.2f} Hz ({100 * family.share:.0f} % of the motion)"
    if course.dies_out:
        reason = f"{at} dies out: its last eighth is {course.growth:.2g} times the first"
        return replace(verdict, kind=STABLE, reason=reason)
    kind = DOUBLING if _is_doubled(family, evidence) else HOPF
    change = 0.0 if motion is None else motion.of_family(family)
    if len(family.lines) == 1:
        return _of_single(family, evidence, course, known.natural, change, replace(verdict, kind=kind))
    sides = f"{at} has {len(family.lines) - 1} side lines at the tooth passing"
    doubt = _doubt(family, course)
    dominant = family.share > HUGE and family.lines[0].sharpness > SHARP
    proven = course.grows or _is_limit_cycle(family, course) or dominant
    if motion is not None and change < LEAST and not proven:
        doubt = f"changes the chip by {100 * change:.1f} % alone, as noise does through a lightly damped mode"
    if not doubt:
        return replace(verdict, kind=kind, reason=f"{sides} and {'grows' if course.grows else 'does not die out'}")
    if cannot_be_noise(family, evidence, change):
        return replace(verdict, kind=kind, reason=f"{sides} and changes the chip by {100 * change:.0f} %")
    return replace(verdict, kind=INCONCLUSIVE, reason=f"{at} {doubt}")


def cannot_be_noise(family: Family, evidence: Evidence, change: float) -> bool:
    """Whether lines change the chip by too much, and too steadily, for the noise of a stable cut."""
    if len(family.lines) == 1 or change < min(least for least, _, _ in FORMS):
        return False
    envelope = envelope_of(evidence.revolutions, family, evidence.spectrum)
    return any(
        change > least and envelope.fluctuation < most and envelope.coherence > coherence
        for least, most, coherence in FORMS
    )


def _is_doubled(family: Family, evidence: Evidence) -> bool:
    return abs(family.place - evidence.revolutions.teeth / 2) < TOLERANCE * evidence.spectrum.resolution


def _of_single(
    family: Family,
    evidence: Evidence,
    course: Course,
    natural: tuple[float, ...],
    change: float,
    verdict: ChatterVerdict,
) -> ChatterVerdict:
    """A large line without side lines; ``verdict`` is that of chatter."""
    line = family.lines[0]
    at = f"the line at {line.frequency:.2f} Hz ({100 * family.share:.0f} % of the motion)"
    near = min((abs(line.frequency / mode - 1) for mode in natural), default=math.inf) < NEAR_A_MODE
    if near or course.grows:
        where = "is near a mode" if near else "has no side lines"
        return replace(verdict, reason=f"{at} {where} and {'grows' if course.grows else 'does not die out'}")
    if change > SHAKEN and family.share > HUGE and not mains_of(line, evidence):
        return replace(verdict, reason=f"{at} changes the chip by {100 * change:.0f} %")
    reason = (
        f"{at} has no side lines at the tooth passing, as a foreign tone has none, but is as large as chatter; "
        "record the machine without cutting and see whether it is still there"
    )
    return replace(verdict, kind=INCONCLUSIVE, reason=reason)


def _is_limit_cycle(family: Family, course: Course) -> bool:
    return family.sharp and course.steadiness < STEADY and family.share > LEAST


def _doubt(family: Family, course: Course) -> str:
    """Why lines with side lines may not be chatter; empty where they are."""
    if course.grows or _is_limit_cycle(family, course):
        return ""
    if family.share < LARGE:
        return (
            f"has side lines at the tooth passing but stays below {100 * LARGE:.0f} %: chatter that begins, noise "
            "through a lightly damped mode, or a foreign tone that the teeth modulate; record longer, or cut deeper"
        )
    if course.steadiness > FLUCTUATING and family.share < HUGE:
        return "fluctuates as noise does through a lightly damped mode; record longer, or cut deeper"
    return ""
