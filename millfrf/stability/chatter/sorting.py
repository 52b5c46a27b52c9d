"""Families of lines sorted into candidates of chatter and foreign tones, and the verdict on each candidate."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..floquet.multipliers import multipliers
from ..settings import THRESHOLDS
from .envelopes import band_envelope
from .evidence import (
    Evidence,
    alternating_change,
    alternation,
    alternation_course,
    alternation_rise,
    envelope_of,
    inequality,
)
from .fitted_depth import ModelledCut, fitted_depth
from .lines import Family, Line
from .spindle import Course, course_of
from .verdict import DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict, ForeignTone, Knowledge

UNMODULATED = "tone without side lines at the tooth passing"  # name of a tone that matches no known source


@dataclass(frozen=True)
class SortedLines:
    """The lines of a recording, sorted by their origin."""

    candidates: tuple[Family, ...]  # families that may be chatter, largest first, with the lines that count
    foreign: tuple[ForeignTone, ...]


def sort_families(evidence: Evidence) -> SortedLines:
    """Sort the families of lines that are large enough.

    Chatter is modulated by the periodic cut and has side lines at the tooth passing. Hum and tones of other machines
    have none. Lines of the power supply are recognised by their frequency as well.
    """
    candidates: list[Family] = []
    foreign: list[ForeignTone] = []
    for family in evidence.families:
        if family.share < THRESHOLDS.negligible:
            continue
        counted = _counted(family, evidence)
        name = _foreign_name(counted, evidence)
        if name:
            foreign.append(ForeignTone(family.lines[0].frequency, family.share, name))
        else:
            candidates.append(counted)
    return SortedLines(tuple(candidates), tuple(foreign))


def _counted(family: Family, evidence: Evidence) -> Family:
    """Remove lines that are too small; if the strongest is a mains line, remove all further mains lines, too."""
    strongest = family.lines[0]
    least = THRESHOLDS.side_line**2 * float((strongest.amplitude**2).sum())
    hum = bool(mains_of(strongest, evidence))
    side_lines = [
        line
        for line in family.lines[1:]
        if (line.amplitude**2).sum() > least and not (hum and mains_of(line, evidence))
    ]
    return replace(family, lines=(strongest, *side_lines))


def _width(line: Line, evidence: Evidence) -> float:
    """Compute the uncertainty of a line's frequency, Hz: resolution of the spectrum plus drift of the spindle."""
    track = evidence.track
    resolution = THRESHOLDS.same_family * evidence.spectrum.resolution * track.mean_frequency
    return resolution + 0.5 * abs(track.drift) * line.frequency


def mains_of(line: Line, evidence: Evidence) -> str:
    """Return a name like ``mains (3 x 50 Hz)`` if a line is a harmonic of the power supply; otherwise empty."""
    for mains in THRESHOLDS.mains:
        number = round(line.frequency / mains)
        width = min(_width(line, evidence), THRESHOLDS.mains_width) + THRESHOLDS.mains_error * mains
        if 1 <= number <= THRESHOLDS.mains_harmonics and abs(line.frequency - number * mains) < width:
            return f"mains ({number} x {mains:g} Hz)"
    return ""


def _foreign_name(family: Family, evidence: Evidence) -> str:
    """Return the name of a foreign tone; empty if the family may be chatter."""
    strongest = family.lines[0]
    if family.share < THRESHOLDS.chance_side_line and _is_alias(strongest, evidence):
        return "order of the spindle, folded by sampling"
    mains = mains_of(strongest, evidence)
    single = len(family.lines) == 1
    if mains and (single or (len(family.lines) == 2 and family.share < THRESHOLDS.chance_side_line)):
        return mains
    if single and family.share < THRESHOLDS.foreign:
        return UNMODULATED
    return ""


def _is_alias(line: Line, evidence: Evidence) -> bool:
    """Check whether a line in the upper spectrum is at a frequency to which sampling folds an order of the spindle."""
    if line.frequency < 0.2 * evidence.sample_rate:
        return False
    spindle = evidence.track.mean_frequency
    order = (evidence.sample_rate - line.frequency) / spindle
    return abs(order - round(order)) * spindle < _width(line, evidence)


def candidate_verdict(family: Family, evidence: Evidence, known: Knowledge, stable: ChatterVerdict) -> ChatterVerdict:
    """Decide whether a candidate family is chatter; return ``stable`` with kind and reason filled in."""
    motion = known.motion
    course = course_of(evidence.revolutions, family.lines[0].order)
    verdict = replace(stable, growth=course.growth, p_value=family.p_value, share=family.share)
    line = line_of(family)
    if course.dies_out:
        reason = f"{line} dies out: its last eighth is {course.growth:.2g} times the first"
        return replace(verdict, kind=STABLE, reason=reason)
    kind = DOUBLING if _is_doubled(family, evidence) else HOPF
    change = 0.0 if motion is None else motion.of_family(family)
    if len(family.lines) == 1:
        return _single_line_verdict(family, evidence, course, known.natural, change, replace(verdict, kind=kind))
    side_lines = f"{line} has {len(family.lines) - 1} side lines at the tooth passing"
    if motion is None:
        return _verdict_by_size(family, evidence, course, known.natural, replace(verdict, kind=kind))
    objection = _objection(family, course)
    dominant = family.share > THRESHOLDS.dominant and family.lines[0].sharpness > THRESHOLDS.sharp
    proven = course.grows or _is_limit_cycle(family, course) or dominant
    if change < THRESHOLDS.small_change and not proven:
        objection = f"changes the chip by only {100 * change:.1f} %, as noise does through a lightly damped mode"
    if not objection:
        return replace(verdict, kind=kind, reason=f"{side_lines} and {'grows' if course.grows else 'does not die out'}")
    if cannot_be_noise(family, evidence, change):
        return replace(verdict, kind=kind, reason=f"{side_lines} and changes the chip by {100 * change:.0f} %")
    return replace(verdict, kind=INCONCLUSIVE, reason=f"{line} {objection}")


def _verdict_by_size(
    family: Family, evidence: Evidence, course: Course, natural: tuple[float, ...], chatter: ChatterVerdict
) -> ChatterVerdict:
    """Judge lines with side lines where the chip is not known; return ``chatter``, or another verdict.

    A cut that is not stable grows until teeth leave the cut, and then moves as much as the forced vibration does.
    Noise of a stable cut moves a lightly damped mode less, and unsteadily.
    """
    side_lines = f"{line_of(family)} has {len(family.lines) - 1} side lines at the tooth passing"
    if course.grows:
        return replace(chatter, reason=f"{side_lines} and grows")
    steadiness = course.steadiness if math.isnan(family.fluctuation) else family.fluctuation
    is_line = family.lines[0].sharpness > THRESHOLDS.sharp
    band = band_envelope(evidence.late, family.lines[0].order, evidence.weights)
    may_be_noise = band.is_noise and not is_line and family.share < THRESHOLDS.dominant
    if family.share > THRESHOLDS.as_large_as_forced and steadiness < THRESHOLDS.passing and not may_be_noise:
        return replace(chatter, reason=f"{side_lines} and does not die out")
    cycle = family.sharp and steadiness < THRESHOLDS.steady
    if cycle and family.share > (THRESHOLDS.limit_cycle if _is_near(family, natural) else THRESHOLDS.modulated):
        return replace(chatter, reason=f"{side_lines} and is as steady as a limit cycle")
    if band.is_steady and _is_wandering(family):
        return replace(chatter, reason=f"{side_lines}, and its envelope is steadier than that of noise")
    if family.share > THRESHOLDS.modulated:
        reason = (
            f"{side_lines}, but is neither so large that noise cannot explain it nor as steady as a limit cycle: noise "
            "through a lightly damped mode, or chatter from time to time; cut deeper, or place the sensor nearer to "
            "the tool"
        )
        return replace(chatter, kind=INCONCLUSIVE, reason=reason)
    if is_line and steadiness < THRESHOLDS.steady and family.share > THRESHOLDS.weak_chatter:
        reason = (
            f"{side_lines} and is steady, but small: weak chatter, or a foreign tone that the teeth modulate; cut "
            "deeper, or place the sensor nearer to the tool"
        )
        return replace(chatter, kind=INCONCLUSIVE, reason=reason)
    return replace(chatter, kind=STABLE, reason=f"{line_of(family)} is too small for chatter and does not grow")


def _is_wandering(family: Family) -> bool:
    """Check whether lines with a steady envelope in a band that is wider than one line are large enough for chatter.

    A tone of another source has one frequency; a small family needs two side lines, as one may be there by chance.
    """
    several = len(family.lines) > THRESHOLDS.sharp_sides
    return family.share > (THRESHOLDS.weak_chatter if several else THRESHOLDS.modulated)


def _is_near(family: Family, natural: tuple[float, ...]) -> bool:
    """Check whether the strongest line is near a natural frequency (Hz)."""
    ratios = (abs(family.lines[0].frequency / mode - 1) for mode in natural)
    return min(ratios, default=math.inf) < THRESHOLDS.near_mode


def line_of(family: Family) -> str:
    """Return the frequency and share of a family in words."""
    return f"the line at {family.lines[0].frequency:.2f} Hz ({100 * family.share:.0f} % of the motion)"


def cannot_be_noise(family: Family, evidence: Evidence, change: float) -> bool:
    """Check whether lines change the chip by too much, and too steadily, for the noise of a stable cut."""
    if len(family.lines) == 1 or change < min(least for least, _, _ in THRESHOLDS.steadiness_of_change):
        return False
    envelope = envelope_of(evidence.revolutions, family, evidence.spectrum)
    return any(
        change > least and envelope.fluctuation < largest and envelope.coherence > coherence
        for least, largest, coherence in THRESHOLDS.steadiness_of_change
    )


def _is_doubled(family: Family, evidence: Evidence) -> bool:
    return abs(family.place - evidence.revolutions.teeth / 2) < THRESHOLDS.half_way * evidence.spectrum.resolution


def _single_line_verdict(
    family: Family,
    evidence: Evidence,
    course: Course,
    natural: tuple[float, ...],
    change: float,
    chatter: ChatterVerdict,
) -> ChatterVerdict:
    """Judge a large line without side lines; return the verdict ``chatter``, or an inconclusive verdict."""
    line = line_of(family)
    near = _is_near(family, natural)
    if near or course.grows:
        place = "is near a mode" if near else "has no side lines"
        return replace(chatter, reason=f"{line} {place} and {'grows' if course.grows else 'does not die out'}")
    passings = family.lines[0].order / evidence.late.teeth
    another_speed = abs(passings / max(round(passings), 1) - 1) < 2 * THRESHOLDS.speed_error
    is_cycle = family.lines[0].sharpness > THRESHOLDS.sharp and family.fluctuation < THRESHOLDS.steady
    least = THRESHOLDS.modulated if is_cycle else THRESHOLDS.as_large_as_forced
    # where the orders are missing, the line may be the tooth passing at another speed; a single edge need not cause any
    has_orders = evidence.shows_orders or evidence.late.teeth == 1
    large = family.share > least and not another_speed and has_orders
    if large and evidence.absent_when_idle(family.lines[0]):
        return replace(chatter, reason=f"{line} is not there while the spindle idles")
    large = change > THRESHOLDS.single_line_change and family.share > THRESHOLDS.dominant
    if large and not mains_of(family.lines[0], evidence):
        return replace(chatter, reason=f"{line} changes the chip by {100 * change:.0f} %")
    reason = (
        f"{line} has no side lines at the tooth passing, as a foreign tone has none, but is as large as chatter; "
        "record the machine without cutting and see whether it is still there"
    )
    return replace(chatter, kind=INCONCLUSIVE, reason=reason)


def _is_limit_cycle(family: Family, course: Course) -> bool:
    return family.sharp and course.steadiness < THRESHOLDS.steady and family.share > THRESHOLDS.limit_cycle


def _objection(family: Family, course: Course) -> str:
    """Return the reason why lines with side lines may not be chatter; empty if they are chatter."""
    if course.grows or _is_limit_cycle(family, course):
        return ""
    if family.share < THRESHOLDS.modulated:
        return (
            f"has side lines at the tooth passing but stays below {100 * THRESHOLDS.modulated:.0f} %: chatter that "
            "begins, noise through a lightly damped mode, or a foreign tone that the teeth modulate; record longer, or "
            "cut deeper"
        )
    if course.steadiness > THRESHOLDS.fluctuating and family.share < THRESHOLDS.dominant:
        return "fluctuates as noise does through a lightly damped mode; record longer, or cut deeper"
    return ""


def alternation_verdict(evidence: Evidence, known: Knowledge, verdict: ChatterVerdict) -> ChatterVerdict:
    """Judge motion that alternates from tooth to tooth; its lines are orders of the spindle.

    Both runout and period doubling cause such motion. ``verdict`` is returned unchanged if nothing alternates.
    """
    runout, motion = known.runout, known.motion
    size = alternation(evidence.late)
    # NaN with an odd number of teeth
    if not size > THRESHOLDS.negligible_alternation or evidence.alternation_p_value > THRESHOLDS.order_p_value:
        return verdict
    teeth = evidence.revolutions.teeth
    course = alternation_course(evidence.revolutions)
    spindle = evidence.track.mean_frequency
    frequency = 0.5 * teeth * spindle
    observed = f"the motion that alternates from tooth to tooth is {size:.2g} times that which does not"
    doubled = replace(
        verdict, kind=DOUBLING, growth=course.growth, p_value=evidence.alternation_p_value, frequency=frequency
    )
    if course.grows:
        return replace(doubled, reason=f"{observed}, and grows")
    has_runout = inequality(evidence.late) > THRESHOLDS.unequal_teeth * size  # and none at half orders
    rises = alternation_rise(evidence.revolutions) > THRESHOLDS.online_rise
    if runout == 0 and known.only_stated and not has_runout and not rises:
        return or_half_the_speed(replace(doubled, reason=observed), spindle)
    if runout == 0:
        warning = f"{observed}; runout, which is stated as zero, or half the stated speed would look the same"
        return replace(doubled, reason=observed, warnings=(warning,))
    change, eccentric = 0.0, math.inf
    if motion is not None:
        change, eccentric = alternating_change(evidence.late, evidence.spectrum, motion), 2 * runout / motion.chip
    leaves = change > THRESHOLDS.out_of_the_cut
    if leaves and change > THRESHOLDS.amplified_runout[teeth != 2] * eccentric:
        reason = f"the chip alternates from tooth to tooth by {100 * change:.0f} % of the thickest"
        warning = f"{reason}; inserts that protrude by more than the stated runout would look the same"
        return replace(doubled, reason=reason, warnings=(warning,))
    by_model = _model_verdict(evidence, known.modelled, known.derivatives, doubled) if known.modelled else None
    if by_model is not None:
        return by_model
    # with two teeth an eccentric spindle makes one cut more and the other less, turn by turn; unequal teeth of a cutter
    # with more of them cause the other orders as well
    unequal = teeth == 2 or inequality(evidence.late) > THRESHOLDS.unequal_teeth * size
    if not leaves and size < THRESHOLDS.alternating and unequal:
        return replace(verdict, warnings=(f"{observed}; it is taken for unequal teeth (runout, or a broken tooth)",))
    reason = (
        f"{observed}: period doubling, or unequal teeth (runout, a broken tooth) that excite the structure at "
        f"{frequency:.2f} Hz; record the entry, or cut at half the depth: there unequal teeth excite less, and chatter "
        "vanishes"
    )
    return replace(doubled, kind=INCONCLUSIVE, frequency=math.nan, reason=reason)


def or_half_the_speed(doubled: ChatterVerdict, spindle: float) -> ChatterVerdict:
    """Leave period doubling open where nothing measured the speed: half of it (Hz) has the same lines."""
    reason = (
        f"{doubled.reason}: period doubling at {60 * spindle:.0f} rpm, or a stable cut at {30 * spindle:.0f} rpm; "
        "measure the speed (a channel in rad/s, or events spindle_speed_rpm)"
    )
    return replace(doubled, kind=INCONCLUSIVE, frequency=math.nan, reason=reason)


def _model_verdict(
    evidence: Evidence, cut: ModelledCut, derivatives: tuple[int, ...], doubled: ChatterVerdict
) -> ChatterVerdict | None:
    """Judge by the multipliers at the fitted depth; None if stability depends on the error of the depth."""
    fitted = fitted_depth(evidence, cut, derivatives)
    if fitted is None or fitted.low <= 0 or fitted.high > THRESHOLDS.widest_depth * fitted.depth:
        return None
    speed = 2 * np.pi * evidence.track.mean_frequency
    radii = [
        multipliers(cut.model, cut.process, speed, depth).spectral_radius
        for depth in (fitted.low, fitted.depth, fitted.high)
    ]
    if min(radii) < 1 <= max(radii):
        return None
    reason = (
        f"by the model, the motion that alternates from tooth to tooth is that of a cut of {1e3 * fitted.depth:.3g} mm "
        f"({1e3 * fitted.low:.3g} to {1e3 * fitted.high:.3g} mm), whose largest multiplier is {radii[1]:.3f}"
    )
    warning = "the verdict was found with the model and is therefore no test of it"
    if min(radii) >= 1:
        return replace(doubled, reason=reason, warnings=(warning,))
    return replace(doubled, kind=STABLE, frequency=math.nan, p_value=1.0, reason=reason, warnings=(warning,))
