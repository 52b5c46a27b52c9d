"""Verdict on a recorded cut, from the lines of its spectrum that are above the noise."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from millfrf.core import InputError, Real

from ..settings import THRESHOLDS
from .envelopes import noise_share
from .evidence import Evidence, ToolMotion, Tracking, gather_evidence, irregular_change
from .fitted_depth import ModelledCut
from .lines import largest_motion, other_line
from .sorting import (
    UNMODULATED,
    SortedLines,
    alternation_verdict,
    candidate_verdict,
    cannot_be_noise,
    or_half_the_speed,
    sort_families,
)
from .spindle import track_spindle
from .stated_speed import modulation_doubt, other_speed, slower_speed_warning, speed_doubt
from .verdict import CHATTER, DOUBLING, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict, Knowledge

_LEAST = THRESHOLDS.least_revolutions


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
    quantities: Sequence[str] = (),
    constant_force: bool = False,
    only_stated: bool = False,
    tracking: Tracking = track_spindle,
) -> ChatterVerdict:
    """Classify a cut at nearly constant speed from forces or vibration.

    A stable cut repeats with every revolution. The spindle is tracked in the recording itself, all its orders are
    subtracted, and the residual is compared with its own local noise floor. Chatter is modulated by the teeth: it has
    lines at ``+-f + k f_tooth``. A line without side lines is a foreign tone. Hopf chatter occurs at any frequency,
    period doubling at half the tooth passing (Insperger, Mann, Stepan & Bayly, Int. J. Mach. Tools Manuf. 43, 2003).
    Where the chip is known, a vibration that changes it more, and more steadily, than the noise of a stable cut can is
    chatter, however small its share of the motion is.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Forces or vibration from the time the tool is fully in the cut, in the SI units of the channels.
    sample_rate : Hz
        Samples per second.
    spindle_speed : rad/s
        Stated spindle speed, right within 1 %; it may drift by 1 %.
    teeth
        Number of teeth.
    runout : m
        Radial offset of the spindle's axis; 0: all teeth cut equal chips; infinite: it may have any size. With an
        even number of teeth runout has the same lines as period doubling. Where these do not grow, and the chip does
        not change by more than runout explains, the verdict is ``inconclusive`` instead of ``period-doubling``.
    derivatives : (n_channels,)
        Number of times each channel is differentiated: 2 for acceleration, 1 for velocity, 0 for displacement or force;
        empty: 0.
    natural_frequencies : Hz
        Natural frequencies of the structure. The line nearest to a mode then gives the chatter frequency; empty: the
        line of largest motion does.
    chip : m
        Thickest chip of the cut without vibration; NaN: not known.
    tool
        Channels that hold the tool's motion across its axis, in m and s; empty: all. Only used with ``chip``.
    modelled
        Cutter, structure and channels of the tip. With them an even number of teeth with runout is judged by the depth
        of cut at which the model moves like the recording. Such a verdict does not test the model.
    quantities : (n_channels,)
        Measured quantity of each channel; sizes are compared within a quantity. Empty: all measure the same.
    constant_force
        Whether the forces of all teeth sum to a constant, so that a stable cut has no line at the tooth passing.
    only_stated
        Whether nothing measured the speed, so that it may be another. Where the lines of the recording are orders of
        a speed within a fifth of the stated one, the cut is judged at that speed; where they are orders of another
        speed, the verdict is ``inconclusive`` and names it. Period doubling that half the speed would explain, too, is
        ``inconclusive``.
    tracking
        How the spindle's angle is found: ``track_spindle``, or ``follow_spindle``.

    Raises
    ------
    InputError
        Fewer than 40 revolutions, samples that are not finite or all equal, or a speed that is not positive.
    """
    again = partial(
        classify_cut,
        sample_rate=sample_rate,
        teeth=teeth,
        runout=runout,
        derivatives=derivatives,
        natural_frequencies=natural_frequencies,
        chip=chip,
        tool=tool,
        modelled=modelled,
        quantities=quantities,
        constant_force=constant_force,
        tracking=tracking,
    )
    data = _checked(samples, sample_rate, spindle_speed, teeth)
    moving = data.std(axis=0) > 0  # channels without motion have no spectrum
    measured = tuple(name for name, moves in zip(quantities, moving, strict=False) if moves)
    evidence = gather_evidence(data[:, moving], sample_rate, spindle_speed, teeth, measured, tracking)
    all_powers = tuple(derivatives) or (0,) * data.shape[1]
    powers = tuple(power for power, moves in zip(all_powers, moving, strict=True) if moves)
    doubt = ""
    if only_stated:
        fitted = other_speed(evidence, data[:, moving], teeth)
        if fitted is not None and fitted.is_near and _turns(data, sample_rate, fitted.frequency) >= _LEAST:
            return again(samples, spindle_speed=2 * math.pi * fitted.frequency)
        doubt = "" if fitted is None else fitted.doubt(evidence.track.mean_frequency)
    known = Knowledge(runout, powers, tuple(natural_frequencies), only_stated=only_stated)
    if math.isfinite(chip) and chip > 0:
        of_tool = np.array([not tool or number in tool for number in range(data.shape[1])])[moving]
        motion = ToolMotion(chip, teeth, evidence.track.mean_frequency, evidence.scales * of_tool, powers)
        known = replace(known, motion=motion)
    if modelled is not None and moving[list(modelled.columns)].all():
        first, second = (int(moving[:column].sum()) for column in modelled.columns)
        known = replace(known, modelled=replace(modelled, columns=(first, second)))
    verdict = _decided(evidence, known)
    # a single edge may never leave the cut, and then its force is constant
    constant_force = constant_force or (teeth == 1 and only_stated and verdict.kind == HOPF)
    doubt = doubt or speed_doubt(
        evidence, data[:, moving], teeth, constant_force=constant_force, only_stated=only_stated
    )
    doubt = doubt or (modulation_doubt(evidence) if only_stated and verdict.kind == HOPF else "")
    if doubt and (evidence.shows_orders or verdict.kind != INCONCLUSIVE):
        verdict = replace(verdict, kind=INCONCLUSIVE, frequency=math.nan, reason=doubt, warnings=())
    warning = slower_speed_warning(evidence) if only_stated and verdict.kind == STABLE else ""
    if warning:
        verdict = replace(verdict, warnings=(*verdict.warnings, warning))
    speed = 2 * math.pi * evidence.track.mean_frequency if evidence.shows_orders else math.nan
    verdict = replace(verdict, spindle_speed=speed, drift=evidence.track.drift)
    if verdict.kind != STABLE or evidence.elsewhere is None:
        return verdict
    other = again(data[evidence.elsewhere], spindle_speed=spindle_speed)
    return _with_other_part(
        verdict, other, evidence.elsewhere.start / sample_rate, evidence.elsewhere.stop / sample_rate
    )


def _with_other_part(stable: ChatterVerdict, other: ChatterVerdict, begin: float, end: float) -> ChatterVerdict:
    """Join the verdict ``stable`` with that on another part (s) of the recording, whose motion does not repeat."""
    alone = f"judge that part alone (millfrf convert REC.h5 PART.h5 --span {begin:.2f} {end:.2f})"
    where = f"from {begin:.2f} to {end:.2f} s"
    if other.kind in CHATTER:
        reason = f"the part that was judged is stable, but {where} the cut seems to chatter ({other.reason}): {alone}"
        return replace(stable, kind=INCONCLUSIVE, reason=reason)
    warning = f"{where} the motion does not repeat, and the verdict does not hold there: {alone}"
    return replace(stable, warnings=(*stable.warnings, warning))


def _checked(samples: Real, sample_rate: float, spindle_speed: float, teeth: int) -> Real:
    data = np.asarray(samples, dtype=float)
    if not spindle_speed > 0 or teeth < 1:
        raise InputError(f"spindle speed {spindle_speed:g} rad/s and {teeth} teeth must be positive")
    turns = _turns(data, sample_rate, spindle_speed / (2 * math.pi))
    if turns < _LEAST:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s hold {math.floor(turns)} revolutions of the spindle; "
            f"{_LEAST} are needed: record longer"
        )
    if not np.isfinite(data).all():
        raise InputError(f"{int((~np.isfinite(data)).sum())} samples are not finite; leave the channel out")
    if not (data.std(axis=0) > 0).any():
        raise InputError(
            "no channel holds any motion: all samples of each are equal; take other responses (--response)"
        )
    return data


def _turns(data: Real, sample_rate: float, spindle: float) -> float:
    """Return the number of revolutions in samples; ``spindle`` is the frequency of the spindle, Hz."""
    return len(data) / sample_rate * spindle


def _decided(evidence: Evidence, known: Knowledge) -> ChatterVerdict:
    """Decide on the verdict; the spindle's speed is added to it later."""
    lines = sort_families(evidence)
    stable = ChatterVerdict(STABLE, evidence.deviation, math.nan, math.nan, foreign=lines.foreign)
    of_lines = _line_verdict(evidence, lines, known, stable)
    if of_lines.kind == DOUBLING and known.only_stated:
        of_lines = or_half_the_speed(of_lines, evidence.track.mean_frequency)
    if of_lines.kind in CHATTER:
        return of_lines
    alternating = alternation_verdict(evidence, known, stable if of_lines.kind == INCONCLUSIVE else of_lines)
    if alternating.kind == DOUBLING:
        return alternating
    for verdict in (_irregular_verdict(evidence, lines, known.motion, stable), of_lines, alternating):
        if verdict.kind != STABLE:
            return verdict
    return _stable_or_inconclusive(evidence, lines, alternating)


def _line_verdict(evidence: Evidence, lines: SortedLines, known: Knowledge, stable: ChatterVerdict) -> ChatterVerdict:
    """Judge the largest candidate family, or a smaller family that changes the chip more than noise can."""
    of_largest, motion = stable, known.motion
    for number, family in enumerate(lines.candidates):
        if number and not (motion and cannot_be_noise(family, evidence, motion.of_family(family))):
            continue
        verdict = candidate_verdict(family, evidence, known, stable)
        if verdict.kind in CHATTER:
            # the amplitude of a sensor away from the tool says little on the tool's motion at another frequency
            line = largest_motion(family.lines, known.derivatives if motion else (), known.natural)
            # tones that are only known to be unmodulated may belong to the chatter
            foreign = tuple(tone for tone in lines.foreign if tone.name != UNMODULATED)
            side_line = math.nan if motion or known.natural else other_line(family.lines, line)
            return replace(verdict, frequency=line.frequency, side_line=side_line, foreign=foreign)
        of_largest = of_largest if number else verdict
    return of_largest


def _irregular_verdict(
    evidence: Evidence, lines: SortedLines, motion: ToolMotion | None, stable: ChatterVerdict
) -> ChatterVerdict:
    """Judge whether the motion is irregular chatter, which neither repeats nor has steady lines."""
    if motion is None or evidence.deviation < THRESHOLDS.irregular_share:
        return stable
    single = [family.lines[0].frequency for family in lines.candidates if len(family.lines) == 1]
    tones = np.array([tone.frequency for tone in lines.foreign] + single) / evidence.track.mean_frequency
    change = irregular_change(evidence.spectrum, motion, tones)
    if change < THRESHOLDS.irregular_change:
        return stable
    orders = evidence.spectrum.orders
    strongest = int(np.argmax(np.where(evidence.spectrum.searched, evidence.spectrum.power.sum(axis=1), 0.0)))
    reason = (
        f"{100 * evidence.deviation:.0f} % of the motion does not repeat, and changes the chip by {100 * change:.0f} %"
    )
    frequency = float(orders[strongest] * evidence.track.mean_frequency)
    return replace(stable, kind=HOPF, frequency=frequency, p_value=evidence.spectrum.p_values.min(), reason=reason)


def _stable_or_inconclusive(evidence: Evidence, lines: SortedLines, verdict: ChatterVerdict) -> ChatterVerdict:
    """Complete a verdict without chatter: inconclusive if the recording could not have shown chatter."""
    if not evidence.shows_orders:
        reason = (
            "no order of the spindle is above the noise within 1.2 % of the stated speed: check that the tool is in "
            "the cut and that the speed is right"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    if evidence.least_share > THRESHOLDS.hidden_line:
        reason = (
            f"noise hides lines of up to {100 * evidence.least_share:.0f} % of the motion; record longer, or place "
            "the sensor nearer to the tool"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    unexplained = math.sqrt(max(evidence.irregular**2 - sum(tone.share**2 for tone in lines.foreign), 0.0))
    lined = any(f.share > THRESHOLDS.modulated and f.lines[0].sharpness > THRESHOLDS.sharp for f in lines.candidates)
    noise = 0.0 if lined or unexplained <= THRESHOLDS.unexplained else noise_share(evidence.late, evidence.weights)
    if noise and math.sqrt(max(unexplained**2 - noise**2, 0.0)) <= THRESHOLDS.unexplained:
        reason = f"{100 * noise:.0f} % of the motion does not repeat, and fluctuates as noise does through modes"
        return replace(verdict, reason=reason)
    if unexplained > THRESHOLDS.unexplained:
        reason = (
            f"{100 * unexplained:.0f} % of the motion does not repeat and is no clear line: noise, a changing cut or "
            "irregular chatter"
        )
        return replace(verdict, kind=INCONCLUSIVE, reason=reason)
    return replace(verdict, reason=verdict.reason or "the motion that does not repeat is noise or foreign")
