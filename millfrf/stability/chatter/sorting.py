"""Families of lines sorted into chatter, forced motion and foreign tones."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..floquet.multipliers import multipliers
from .evidence import Evidence, alternating_change, alternation, alternation_course, envelope_of
from .fitted_depth import ModelledCut, fitted_depth
from .lines import SHARP, TOLERANCE, Family, Line
from .orders import Course, course_of
from .verdict import DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict, ForeignTone, Knowledge

MAINS = (50.0, 60.0)
"""Frequencies of the power supply, Hz."""
_MAINS_ERROR = 0.004  # relative, beside the resolution of the spectrum
_MAINS_HARMONICS = 20
_WIDEST = 0.5  # Hz; a line that is known less well is not named by its frequency
UNMODULATED = "tone without side lines at the tooth passing"
"""Name of a tone that is known by nothing else."""
SMALL = 0.03
"""Share of the motion below which lines do not matter: no limit cycle is as small."""
TOO_LARGE = 0.3
"""Share of the motion from which a line without side lines is not called foreign."""
_SIDE = 0.02  # least size of a side line over the strongest
_CHANCE = 0.15  # share of the motion below which one side line may be there by chance


@dataclass(frozen=True)
class Sorted:
    """The lines of a recording, sorted by their origin.

    Parameters
    ----------
    suspects
        Families that may be chatter, largest first, with the lines that count.
    foreign
        Tones that are not.
    """

    suspects: tuple[Family, ...]
    foreign: tuple[ForeignTone, ...]


def sort_families(evidence: Evidence) -> Sorted:
    """Sort the families of lines that matter.

    Chatter is modulated by the periodic cut and has side lines at the tooth passing; hum and other machines' tones have
    none, and lines of the power supply are known by their frequency as well.
    """
    suspects: list[Family] = []
    foreign: list[ForeignTone] = []
    for family in evidence.families:
        if family.share < SMALL:
            continue
        counted = _counted(family, evidence)
        name = _foreign_name(counted, evidence)
        if name:
            foreign.append(ForeignTone(family.lines[0].frequency, family.share, name))
        else:
            suspects.append(counted)
    return Sorted(tuple(suspects), tuple(foreign))


def _counted(family: Family, evidence: Evidence) -> Family:
    """The family without lines that are too small or that are the supply's beside another of the supply."""
    strongest = family.lines[0]
    size = float((strongest.amplitude**2).sum())
    hum = bool(mains_of(strongest, evidence))
    lines = [strongest]
    for line in family.lines[1:]:
        if (line.amplitude**2).sum() > _SIDE**2 * size and not (hum and mains_of(line, evidence)):
            lines.append(line)
    return replace(family, lines=tuple(lines))


def mains_of(line: Line, evidence: Evidence) -> str:
    """Name a line of the mains as :func:`mains_name` does, to the accuracy of a line's frequency in the recording."""
    track = evidence.track
    return mains_name(line.frequency, width_of(line, evidence.spectrum.resolution, track.mean_frequency, track.drift))


def _foreign_name(family: Family, evidence: Evidence) -> str:
    """Name of a tone that is foreign; empty where it may be chatter."""
    strongest, track = family.lines[0], evidence.track
    width = width_of(strongest, evidence.spectrum.resolution, track.mean_frequency, track.drift)
    if family.share < _CHANCE and is_alias(strongest, evidence.sample_rate, track.mean_frequency, width):
        return "order of the spindle, folded by sampling"
    mains = mains_name(strongest.frequency, width)
    alone = len(family.lines) == 1
    if mains and (alone or (len(family.lines) == 2 and family.share < _CHANCE)):
        return mains
    if alone and family.share < TOO_LARGE:
        return UNMODULATED
    return ""


def mains_name(frequency: float, width: float) -> str:
    """``mains (3 x 50 Hz)`` where a frequency (Hz, known within ``width``) is one of the supply's; else empty."""
    for mains in MAINS:
        number = round(frequency / mains)
        if (
            1 <= number <= _MAINS_HARMONICS
            and abs(frequency - number * mains) < min(width, _WIDEST) + _MAINS_ERROR * mains
        ):
            return f"mains ({number} x {mains:g} Hz)"
    return ""


def is_alias(line: Line, sample_rate: float, spindle: float, width: float) -> bool:
    """Whether a line lies where sampling folds high orders of the spindle, in the upper part of the spectrum."""
    if line.frequency < 0.2 * sample_rate:
        return False
    away = (sample_rate - line.frequency) / spindle
    return abs(away - round(away)) * spindle < width


def width_of(line: Line, resolution: float, spindle: float, drift: float) -> float:
    """How well a line's frequency is known, Hz: the spectrum's resolution, and drift that widens it."""
    return TOLERANCE * resolution * spindle + 0.5 * abs(drift) * line.frequency


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


_LARGEST = 10.0  # largest depth that is believed over the best; a wider range tells nothing


def told_by_model(
    evidence: Evidence, cut: ModelledCut, derivatives: tuple[int, ...], doubled: ChatterVerdict
) -> ChatterVerdict | None:
    """Give the verdict on motion that alternates, where the error of the depth does not change the cut's stability.

    Parameters
    ----------
    evidence
        Evidence gathered from the recording.
    cut
        Cutter, structure and channels of the tip.
    derivatives : (n_channels,)
        Number of times each channel is differentiated: 2 for acceleration, 1 for velocity, 0 for displacement.
    doubled
        The verdict of period doubling so far.

    Returns
    -------
    ChatterVerdict or None
        None where the model does not tell.
    """
    fitted = fitted_depth(evidence, cut, derivatives)
    if fitted is None or fitted.low <= 0 or fitted.high > _LARGEST * fitted.depth:
        return None
    speed = 2 * np.pi * evidence.track.mean_frequency
    sizes = [
        multipliers(cut.model, cut.process, speed, depth).spectral_radius
        for depth in (fitted.low, fitted.depth, fitted.high)
    ]
    if min(sizes) < 1 <= max(sizes):
        return None
    told = (
        f"with the model, the motion that alternates from tooth to tooth is that of a cut of {1e3 * fitted.depth:.3g} "
        f"mm ({1e3 * fitted.low:.3g} to {1e3 * fitted.high:.3g} mm), whose largest multiplier is {sizes[1]:.3f}"
    )
    warning = "told with the model, of which the verdict is therefore no test"
    if min(sizes) >= 1:
        return replace(doubled, reason=told, warnings=(warning,))
    return replace(doubled, kind=STABLE, frequency=float("nan"), p_value=1.0, reason=told, warnings=(warning,))


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
