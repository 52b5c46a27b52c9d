"""Tests whether a fitted cause of a structure is significant and its numbers are possible."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real, listed

from ..inference.diagnosis import IMPOSSIBLE, SCREENED, AcceptedCause
from ..inference.search import Proposal, Search
from ..inference.settings import EvidenceSettings
from ..joints.joint_law import JointMotion
from ..joints.time_loops import driven_run
from ..models.cause import Cause
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..models.model_terms import counted_at_tip, spread_with_scale
from ..physics.linear_causes import MOST_DAMPED, AcCoupling, MissingMode
from ..physics.protocol import ChainPhysics, JointPhysics, LimitedPhysics, TwinPhysics, reported_name
from ..screening.joint_starts import phases_too_large

BAND_MARGIN = 1.15  # a mode beyond the compared band affects it up to this ratio to the end of the band

# share of a mode's power in its largest response from which the mode is taken to appear in this response alone;
# the power of each response is relative to its measured power
SINGLE_RESPONSE_SHARE = 0.99

# what must differ from zero: numbers of the last cause, these referred to the motion of the tip, or the force of a law
Measured = Literal["numbers", "tip", "force"]

# laws between which dry friction and hysteresis merge: sliding with presliding, and presliding with sliding
FRICTION_FAMILY = ("coulomb_friction", "hysteresis")

FORCE_STEP = 1e-3  # step of a coordinate for the derivative of the size of a force

MOTION_SAMPLES, MOTION_PERIODS = 4096, 20  # of the motion for which the size of a force is computed

MIN_ERRORS = 2.0  # standard errors by which a number of a reported linear cause must differ from that of no cause

MAX_STEPS = 60  # most steps in which modes may compensate the removal of a cause


def impossible(proposal: Proposal[Fit], settings: EvidenceSettings) -> str:
    """Return why the numbers of the last cause are impossible; an empty text if they are possible.

    For a law with its own axis, the phases of the axis and the frequencies of the modes are checked instead.
    """
    cause = proposal.fitted.hypothesis.causes[-1]
    if cause.axis is not None:
        return phases_too_large(cause.axis) or _far_modes(proposal.fitted.hypothesis, settings.farthest)
    if isinstance(cause.physics, MissingMode):
        fitted = proposal.fitted.hypothesis
        return cause.physics.overdamped(complex(fitted.model.poles[-1])) or lost_mode(fitted)
    reason: Callable[[Real, Real], str] | None = getattr(cause.physics, "impossible", None)
    if reason is None:
        return ""
    steps = np.array([parameter.unit_step for parameter in cause.physics.parameters])
    return reason(cause.values, settings.clear * _spread(proposal.fitted, cause) * steps)


def _far_modes(hypothesis: Hypothesis, farthest: float) -> str:
    """Return a text on the mode that is implausibly far from its nominal frequency; empty if there is none."""
    shape = hypothesis.shape
    deviations = shape.modal_rows(hypothesis.u)[: shape.nominal_modes, 0]
    if np.abs(deviations).max() <= farthest:
        return ""
    mode = int(np.argmax(np.abs(deviations)))
    before, after = (model.natural_frequencies[mode] for model in (shape.nominal, hypothesis.model))
    return f"the mode at {before:.4g} Hz would have to lie at {after:.4g} Hz"


def lost_mode(hypothesis: Hypothesis) -> str:
    """Return a text on the first nominal mode whose damping is too large for a resonance; empty if there is none.

    Such a mode imitates an effect that the model lacks.
    """
    nominal = hypothesis.shape.nominal
    pairs = zip(nominal.damping_ratios, hypothesis.model.damping_ratios, nominal.natural_frequencies, strict=False)
    for before, now, frequency in pairs:
        if before <= MOST_DAMPED < now:
            return f"the mode at {frequency:.4g} Hz would have to be damped by {100 * now:.0f} %"
    return ""


def modes_outside_band(hypothesis: Hypothesis, lines: Sequence[WindowedSpectrum]) -> list[int]:
    """Return the indices of the causes whose added mode is overdamped or lies outside the compared band.

    A mode may have left the band when later causes were accepted.
    """
    low, high = (
        min(recording.frequencies[0] for recording in lines),
        max(recording.frequencies[-1] for recording in lines),
    )
    added = [(k, cause.physics) for k, cause in enumerate(hypothesis.causes) if isinstance(cause.physics, MissingMode)]
    poles = hypothesis.model.poles[hypothesis.shape.nominal_modes :]
    return [
        place
        for (place, physics), pole in zip(added, poles, strict=True)
        if physics.overdamped(complex(pole)) or not low / BAND_MARGIN <= abs(pole) / (2 * np.pi) <= BAND_MARGIN * high
    ]


def plausible_proposals(proposals: Sequence[Proposal[Fit]], settings: EvidenceSettings) -> list[Proposal[Fit]]:
    """Return the proposals with possible numbers and sufficient evidence, most evidence first."""
    plausible = [
        proposal for proposal in proposals if proposal.evidence >= settings.least and not impossible(proposal, settings)
    ]
    return sorted(plausible, key=lambda proposal: -proposal.evidence)


def plainest(proposals: Sequence[Proposal[Fit]], as_good: float) -> Proposal[Fit] | None:
    """Return the form with the fewest numbers among the equally good forms of the cause with most evidence.

    ``proposals`` are sorted by evidence. A form is equally good if its evidence is less than ``as_good`` below the
    largest evidence. None is returned if there are no proposals.
    """
    if not proposals:
        return None
    best = proposals[0]
    forms = [
        proposal for proposal in proposals if proposal.name == best.name and proposal.evidence > best.evidence - as_good
    ]
    return min(forms, key=lambda form: (form.fitted.hypothesis.size, form.fitted.score))


def simplest_forms(fitted: Fit, lines: list[WindowedSpectrum], as_good: float) -> Fit:
    """Fit causes with several forms in the best form that they have together with all other causes.

    A cause takes its form before later ones are known. The forms of a physics are sorted by ``places``, simplest first.
    A simpler form replaces the fitted one unless it loses ``as_good`` evidence, a less simple one if it gains as much.
    """
    for number, cause in enumerate(fitted.hypothesis.causes):
        if not isinstance(cause.physics, AcCoupling):
            continue
        order = cause.physics.places(fitted.hypothesis.shape.nominal)
        for place, values in cause.physics.other_forms(cause.values, cause.place):
            causes = list(fitted.hypothesis.causes)
            causes[number] = replace(cause, place=place, values=values)
            hypothesis = replace(fitted.hypothesis, causes=tuple(causes))
            other = fit(lines, hypothesis, fitted.noises, iterations=MAX_STEPS)
            simpler = order.index(place) < order.index(cause.place)
            if other.score < fitted.score + (as_good if simpler else -as_good):
                fitted = other
    return fitted


def twins_of(best: Proposal[Fit], proposals: Sequence[Proposal[Fit]], share: float) -> list[Proposal[Fit]]:
    """Return the best law and its twins with nearly the same evidence, smallest modal deviation first.

    Twins are two laws that differ by a linear spring, for instance stiffness added beyond a knee and stiffness missing
    within it. A small difference in evidence may only come from the inexact form of both laws. Therefore the
    plausibility of the modes decides between them.
    """
    physics = best.fitted.hypothesis.causes[-1].physics
    twin = physics.twin if isinstance(physics, TwinPhysics) else ""
    near = [
        proposal
        for proposal in proposals
        if proposal.fitted.hypothesis.causes[-1].physics.name == twin
        and proposal.evidence > (1 - share) * best.evidence
    ]
    return sorted([best, *near], key=lambda proposal: proposal.fitted.deviation)


def has_law_beyond_limits(hypothesis: Hypothesis) -> bool:
    """Return whether the numbers of a law lie beyond the limits of its name."""
    return bool(names_beyond_limits(hypothesis))


def impossible_rival(search: Search[Fit], laws: Collection[str]) -> str:
    """Return a sentence on a linear cause with impossible numbers that explains more than all accepted causes.

    What is missing is then linear and outside the library, and the accepted causes describe a part of it by chance. The
    text is empty if there is no such cause. ``laws``: names of the joint laws.
    """
    total = search.base.score - search.current.score
    rivals = [
        candidate
        for candidate in search.candidates
        if candidate.stage == IMPOSSIBLE and candidate.name not in laws and candidate.evidence > total
    ]
    if not search.accepted or not rivals:
        return ""
    rival = max(rivals, key=lambda candidate: candidate.evidence)
    names = listed(list(dict.fromkeys(proposal.name for proposal in search.accepted)))
    return (
        f"{rival.name} would explain more (evidence {rival.evidence:.0f}) than {names} ({total:.0f}), but "
        f"{rival.location['impossible']}: what is missing is linear and outside the library"
    )


def unproved_law(search: Search[Fit], laws: Collection[str], large: float) -> str:
    """Return a sentence on a joint law that no simulation proves, but whose score test gains more than ``large``.

    The score test takes the motion from the measured responses. Its gain shows that the residual is no noise, also
    where the law has not the true form or its simulation does not follow the motion. The text is empty if there is no
    such law, or if causes were accepted. ``laws``: names of the joint laws.
    """
    tested = [
        candidate
        for candidate in search.candidates
        if candidate.stage == SCREENED and candidate.name in laws and candidate.evidence > large
    ]
    if search.accepted or not tested:
        return ""
    law = max(tested, key=lambda candidate: candidate.evidence)
    return (
        f"for the measured motion, {law.name} would explain much (evidence {law.evidence:.0f}), but no simulation of "
        "it fits: the residual is no noise"
    )


def names_beyond_limits(hypothesis: Hypothesis) -> tuple[str, ...]:
    """Return the names of the laws that lie beyond the limits at which the numbers of fitted laws end, each name once.

    At such a limit the fitted law and the law beyond it describe the data equally well.
    """
    names = [
        cause.physics.beyond
        for cause in hypothesis.laws
        if isinstance(cause.physics, LimitedPhysics)
        and cause.motion is not None
        and cause.physics.beyond_limits(cause.values, cause.motion)
    ]
    return tuple(dict.fromkeys(names))


def undetermined_beyond_limits(hypothesis: Hypothesis, causes: Sequence[AcceptedCause]) -> str:
    """Return a sentence on the only law if its numbers lie beyond the limits of its name and its size is not known.

    A friction of which only the damping at low speeds is determined, but not the force at which it slides, is a damping
    of some form. Between friction and hysteresis a limit is a matter of degree. The text is empty if there is no such
    law.
    """
    laws, beyond = hypothesis.laws, names_beyond_limits(hypothesis)
    if len(laws) > 1 or not beyond or beyond[0] in FRICTION_FAMILY:
        return ""
    reported = [cause for cause in causes if cause.name == reported_name(laws[0].physics)]
    if not reported:
        return ""
    [cause] = reported
    size, value = next(iter(cause.parameters.items()))
    error = cause.standard_errors[size]
    if abs(value) >= MIN_ERRORS * error:
        return ""
    return (
        f"{cause.name} is not shown: {size} is not determined ({value:.2g} ± {error:.2g}), and the other numbers end "
        f"at a limit, beyond which the force is that of {beyond[0]}; a recording with larger motion can decide"
    )


def required_evidence(current: Fit, base: Fit, settings: EvidenceSettings, *, own: bool = False) -> float:
    """Return the gain in score that a further cause needs.

    A cause with a smaller gain may only correct the form of earlier causes. ``own`` states that the cause is known to
    be independent of the form of the laws, and then needs less.
    """
    if current.hypothesis.laws:
        share = settings.small if own else settings.small_after_law
    else:
        share = settings.small_after_linear
    return max(settings.least, share * (base.score - current.score))


def corrects_clipping_repair(
    proposal: Proposal[Fit],
    limits: Mapping[int, float],
    lines: Sequence[WindowedSpectrum],
    settings: EvidenceSettings,
) -> bool:
    """Return whether the last cause is a mode that only describes errors of the repair of a clipped channel.

    The clipped samples of a channel were replaced by a prediction, whose errors look like a resonance of this channel
    alone. The evidence of such a mode is small compared with the evidence of the limit. ``limits`` holds the evidence
    of each limit by the index of the response.
    """
    fitted = proposal.fitted.hypothesis
    if not limits or not isinstance(fitted.causes[-1].physics, MissingMode):
        return False
    size = np.sqrt(np.mean([np.mean(np.abs(recording.measured) ** 2, axis=0) for recording in lines], axis=0))
    power = np.abs(fitted.model.right[-1] / size) ** 2
    response = int(np.argmax(power))
    if power[response] < SINGLE_RESPONSE_SHARE * power.sum():
        return False
    return proposal.evidence < settings.small * limits.get(response, 0.0)


def is_significant(
    proposal: Proposal[Fit],
    current: Fit,
    base: Fit,
    lines: list[WindowedSpectrum],
    settings: EvidenceSettings,
    *,
    own: bool = False,
    by: Measured = "numbers",
) -> bool:
    """Return whether a cause has sufficient evidence from the misfit or from the prior of the modal parameters.

    A cause that gains by the prior alone must remove most of the implausible deviation of the modes. It must also be
    more likely than a laboratory error in all damping ratios, or in all frequencies.

    ``own`` states that the cause is known to be independent of the form of the laws. ``by`` states what must be clear
    of a joint's law: its ``numbers``, these referred to the motion of the ``tip``, or its ``force``.
    """
    fitted, needed = proposal.fitted, required_evidence(current, base, settings, own=own)
    if isinstance(fitted.hypothesis.causes[-1].physics, MissingMode):
        if modes_outside_band(fitted.hypothesis, lines):
            return False
        needed = max(needed + _places_of_a_mode(fitted, lines), settings.stands_out * _numbers_in_a_mode(fitted, lines))
        clear = _mode_measured(fitted, settings.clear)
    else:
        clear = by != "force" and _measured(fitted, settings.clear, at_tip=by == "tip")
        needed *= 1.0 if clear else settings.unclear
    clear = clear or (by == "force" and force_is_clear(fitted, settings.clear))
    if proposal.evidence < needed or not (clear or _is_missed(fitted, lines, needed)):
        return False
    if current.misfit - fitted.misfit > settings.least:
        return True
    excess = max(current.deviation - current.hypothesis.shape.size, 1.0)
    if current.deviation - fitted.deviation <= settings.nearer_nominal * excess:
        return False
    return proposal.evidence > _plainer_gain(current, lines)


def _plainer_gain(current: Fit, lines: list[WindowedSpectrum]) -> float:
    """Return the larger gain in score if the prior of all frequencies, or of all damping ratios, is dropped."""
    shape = current.hypothesis.shape
    rows = shape.modal_rows(current.hypothesis.u)[: shape.nominal_modes]
    cost = float(np.log(2 * sum(recording.measured.size for recording in lines)))
    return max(float(np.sum(rows[:, k] ** 2 - cost)) for k in (0, 1))


def _places_of_a_mode(fitted: Fit, lines: list[WindowedSpectrum]) -> float:
    """Return the evidence that noise alone gives to the best of all frequencies at which the last mode may lie.

    The number of such frequencies is the width of the compared band over the bandwidth of the mode.
    """
    pole = fitted.hypothesis.model.poles[-1]
    band = max(recording.frequencies[-1] for recording in lines) - min(recording.frequencies[0] for recording in lines)
    return 2 * float(np.log(max(band / (-float(pole.real) / np.pi), 1.0)))


def _numbers_in_a_mode(fitted: Fit, lines: list[WindowedSpectrum]) -> int:
    """Return the number of real values measured within the half-power band, ``2 zeta f``, of the last mode."""
    pole = fitted.hypothesis.model.poles[-1]
    centre, half = abs(pole) / (2 * np.pi), -float(pole.real) / (2 * np.pi)
    inside = (np.abs(recording.frequencies - centre) <= half for recording in lines)
    return sum(
        2 * int(np.sum(which)) * recording.measured.shape[1] for which, recording in zip(inside, lines, strict=True)
    )


def _is_missed(fitted: Fit, lines: list[WindowedSpectrum], needed: float) -> bool:
    """Return whether the fit without the last cause is clearly worse although the modes are refitted.

    Only a fault of the measuring chain is tested. Real modes imitate a delay to first order, which gives the delay a
    large standard error even if it differs from zero.
    """
    hypothesis = fitted.hypothesis
    if not isinstance(hypothesis.causes[-1].physics, ChainPhysics):
        return False
    without = replace(hypothesis, causes=hypothesis.causes[:-1])
    return fit(lines, without, fitted.noises, iterations=MAX_STEPS).score - fitted.score > needed


def _mode_measured(fitted: Fit, clear: float) -> bool:
    """Return whether the damping of the last added mode differs from zero by ``clear`` standard errors."""
    shape = fitted.hypothesis.shape
    place = shape.per_mode * (len(shape.nominal.poles) - 1) + 1
    return float(np.sqrt(np.maximum(fitted.covariance[place, place], 0.0))) * shape.lab.damping < 1 / clear


def _measured(fitted: Fit, clear: float, *, at_tip: bool) -> bool:
    """Return whether the last cause differs from no cause by ``clear`` standard errors."""
    cause = fitted.hypothesis.causes[-1]
    spread = _spread_at_tip(fitted) if at_tip else _spread(fitted, cause)
    return _differs(fitted.hypothesis, cause, spread, clear)


def _differs(hypothesis: Hypothesis, cause: Cause, spread: Real, clear: float) -> bool:
    """Return whether a cause differs from no cause by ``clear`` of the standard errors ``spread`` (n_parameters,).

    For a fault of the measuring chain any number that states its size counts, for a joint law the first number.
    """
    absent = cause.physics.start(hypothesis.shape.nominal) if isinstance(cause.physics, ChainPhysics) else None
    significant = []
    for k, (parameter, error) in enumerate(zip(cause.physics.parameters, spread, strict=True)):
        if parameter.logarithmic:
            significant.append(error * parameter.unit_step < 1 / clear)
        else:
            zero = 0.0 if absent is None else float(absent[k])
            significant.append(abs(float(cause.values[k]) - zero) > clear * error * parameter.unit_step)
    return any(significant[cause.physics.sizes]) if isinstance(cause.physics, ChainPhysics) else significant[0]


def undetermined_causes(fitted: Fit, evidences: Sequence[float], settings: EvidenceSettings) -> list[int]:
    """Return the indices of linear causes whose numbers may be those of no cause.

    No number differs by two standard errors, which may count the spread between parts of the recordings
    (:func:`millfrf.mismatch.structure.reported_causes.with_form_spread`), and the evidence is too small for a cause
    without a clear number.
    """
    hypothesis, first, places = fitted.hypothesis, fitted.hypothesis.shape.size, []
    for place, (cause, evidence) in enumerate(zip(hypothesis.causes, evidences, strict=True)):
        own, first = slice(first, first + len(cause.values)), first + cause.size
        if not isinstance(cause.physics, ChainPhysics) or evidence >= settings.large:
            continue
        spread = np.sqrt(np.maximum(np.diag(fitted.covariance)[own], 0.0))
        if not _differs(hypothesis, cause, spread, MIN_ERRORS):
            places.append(place)
    return places


def force_is_clear(fitted: Fit, clear: float) -> bool:
    """Return whether the force of the last cause, a law, differs from zero by ``clear`` standard errors.

    The numbers of a law may be undetermined although its force is known: of a spring that softens without yielding,
    ``k x^3 / x0^2``, only the ratio of stiffness and knee is determined; of a slider that slides almost always, only
    the product of stiffness and yield. The size of the force is the root mean square of the part that neither a linear
    spring nor a damper takes up, over a broadband motion as large as that of the joint; d ln(size) follows from the
    covariance of the numbers.
    """
    cause = fitted.hypothesis.causes[-1]
    if not isinstance(cause.physics, JointPhysics) or cause.motion is None:
        return False
    law = cause.law()
    if law.ramp or law.bend:
        return False
    x, v = _broadband_motion(cause.motion)
    linear = np.stack([x / cause.motion.deflection, v / cause.motion.velocity], axis=1)

    def size(coordinates: Real) -> float:
        law, force = cause.moved(coordinates).law(), np.empty(len(x))
        driven_run(x, v, law.tables(), (law.reach, law.speed), np.zeros(len(x)), (law.springs, law.yields), force)
        return float(np.linalg.norm(force - linear @ np.linalg.lstsq(linear, force, rcond=None)[0]))

    start, present = cause.coordinates(), size(cause.coordinates())
    if not present > 0:
        return False
    steps = FORCE_STEP * np.sign(cause.difference_steps())  # away from a limit at which a number ends
    moves = np.diag(steps)[: len(cause.values)]
    slopes = np.array([(size(start + move) - present) / move.sum() for move in moves])
    variance = slopes @ spread_with_scale(fitted, len(fitted.hypothesis.causes) - 1) @ slopes
    return bool(np.sqrt(max(variance, 0.0)) < present / clear)


def _broadband_motion(motion: JointMotion) -> tuple[Real, Real]:
    """Return deflection and velocity, each (n_samples,), of a sum of sinusoids of the joint's size and frequency."""
    phases = 2 * np.pi * np.arange(MOTION_SAMPLES) / MOTION_SAMPLES
    orders = MOTION_PERIODS + np.arange(-2, 3) * (MOTION_PERIODS // 5)
    shifts = np.pi * orders**2 / 7.0  # no common peak
    x, v = (np.sum(wave(np.outer(orders, phases) + shifts[:, None]), axis=0) for wave in (np.sin, np.cos))
    return x * motion.deflection / x.std(), v * motion.velocity / v.std()


def _spread_at_tip(fitted: Fit) -> Real:
    """Return the standard errors of the last law if deflections are referred to the tip, (n_parameters,)."""
    counted = replace(fitted, hypothesis=counted_at_tip(fitted.hypothesis))
    covariance = spread_with_scale(counted, len(fitted.hypothesis.causes) - 1)
    return np.sqrt(np.maximum(np.diag(covariance)[: len(counted.hypothesis.causes[-1].values)], 0.0))


def _spread(fitted: Fit, cause: Cause) -> Real:
    """Return the standard errors of the coordinates of the last cause, (n_parameters,)."""
    first = fitted.hypothesis.size - cause.size
    return np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + len(cause.values)], 0.0))
