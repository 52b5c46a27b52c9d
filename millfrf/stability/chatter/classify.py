"""Verdict on a recorded cut, from the lines that stand out of its noise."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from millfrf.core import InputError, Real

from .evidence import Evidence, ToolMotion, gather_evidence, irregular_change
from .fitted_depth import ModelledCut
from .lines import largest_motion
from .sorting import SILENT, UNMODULATED, Sorted, cannot_be_noise, of_alternation, of_suspect, sort_families
from .verdict import CHATTER, DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict, Knowledge

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


FEWEST_REVOLUTIONS = 40


def classify_cut(
    samples: Real,
    sample_rate: float,
    spindle_speed: float,
    teeth: int,
    *,
    runout: float = math.inf,
    derivatives: Sequence[int] = (),
    natural_frequencies: Sequence[float] = (),
    chip: float = math.nan,
    tool: Sequence[int] = (),
    modelled: ModelledCut | None = None,
) -> ChatterVerdict:
    """Classify a cut at nearly constant speed from forces or vibration.

    The spindle is followed in the recording itself and all its orders are taken away: a stable cut repeats with every
    revolution. What is left is held against its own local noise floor. Chatter is modulated by the teeth: it has lines
    at ``+-f + k f_tooth``; a line without any is a foreign tone. Hopf chatter lies anywhere, period doubling at half
    the tooth passing (Insperger, Mann, Stepan & Bayly, Int. J. Mach. Tools Manuf. 43, 2003). Where the chip is known,
    a vibration that changes it more, and more steadily, than the noise of a stable cut can is chatter however small its
    share of the motion is.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Forces or vibration from the time the tool is fully in the cut, in the SI units of the channels.
    sample_rate : Hz
        Samples a second.
    spindle_speed : rad/s
        Stated spindle speed, right within 1 %; it may drift by 1 %.
    teeth
        Number of teeth.
    runout : m
        Radial offset of the spindle's axis; 0: all teeth cut equal chips; infinite: it may have any size. With an even
        number of teeth runout has the lines of period doubling: where they do not grow, and the chip does not change by
        more than runout explains, the verdict is ``inconclusive`` instead of ``period-doubling``. NaN: not stated;
        period doubling is then told with a warning where it is large.
    derivatives : (n_channels,)
        Number of times each channel is differentiated: 2 for acceleration, 1 for velocity, 0 for displacement or force;
        empty: 0.
    natural_frequencies : Hz
        Natural frequencies of the structure. With them the line nearest to a mode gives the frequency; empty: the line
        of largest motion does.
    chip : m
        Thickest chip of the cut without vibration; NaN: not known.
    tool
        Channels that hold the tool's motion across its axis, in m and s; empty: all. Only used with ``chip``.
    modelled
        Cutter, structure and channels of the tip. With them an even number of teeth with runout is judged by the depth
        of cut at which the model moves like the recording. The verdict is then no test of the model.

    Raises
    ------
    InputError
        Fewer than 40 revolutions, samples that are not finite or all equal, or a speed that is not positive.
    """
    data = _checked(samples, sample_rate, spindle_speed, teeth)
    moving = data.std(axis=0) > 0
    evidence = gather_evidence(data[:, moving], sample_rate, spindle_speed, teeth)
    powers = tuple(derivatives) or (0,) * data.shape[1]
    kept = tuple(power for power, moves in zip(powers, moving, strict=True) if moves)
    known = Knowledge(runout, kept, tuple(natural_frequencies))
    if math.isfinite(chip) and chip > 0:
        counted = np.array([not tool or number in tool for number in range(data.shape[1])])[moving]
        motion = ToolMotion(chip, teeth, evidence.track.mean_frequency, evidence.scales * counted, kept)
        known = replace(known, motion=motion)
    if modelled is not None and moving[list(modelled.columns)].all():
        first, second = (int(moving[:column].sum()) for column in modelled.columns)
        known = replace(known, modelled=replace(modelled, columns=(first, second)))
    verdict = concluded(evidence, known)
    speed = 2 * math.pi * evidence.track.mean_frequency
    return replace(verdict, spindle_speed=speed, drift=evidence.track.drift)


def _checked(samples: Real, sample_rate: float, spindle_speed: float, teeth: int) -> Real:
    data = np.asarray(samples, dtype=float)
    if not spindle_speed > 0 or teeth < 1:
        raise InputError(f"spindle speed {spindle_speed:g} rad/s and {teeth} teeth must be positive")
    turns = len(data) / sample_rate * spindle_speed / (2 * math.pi)
    if turns < FEWEST_REVOLUTIONS:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s hold {turns:.0f} revolutions of the spindle; "
            f"{FEWEST_REVOLUTIONS} are needed: record longer"
        )
    if not np.isfinite(data).all():
        raise InputError(f"{int((~np.isfinite(data)).sum())} samples are not finite; leave the channel out")
    if not (data.std(axis=0) > 0).any():
        raise InputError(
            "no channel holds any motion: all samples of each are equal; take other responses (--response)"
        )
    return data
