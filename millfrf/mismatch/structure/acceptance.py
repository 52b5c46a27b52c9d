"""When a fitted cause of a structure is worth accepting, and when its law is not what its name means."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..inference.search import Proposal
from ..inference.settings import EvidenceSettings
from ..models.fitting import Fit, fit
from ..models.hypothesis import Cause, Hypothesis
from ..models.model_terms import counted_at_tip, spread_with_scale
from ..physics.protocol import ChainPhysics, LimitedPhysics, ModePhysics, TwinPhysics
from ..physics.structural import MOST_DAMPED
from ..screening.joint_starts import phases_too_large

BESIDE = 1.15
"""Factor on an end of the compared band within which a mode beyond it still shapes what lies inside."""

ALONE = 0.99
"""Share of a mode's power, each response in units of what was measured, from which one response shows it alone."""

TO_REST = 60
"""Steps at most for modes to make up for a cause that is taken away."""


def impossible(proposal: Proposal[Fit], settings: EvidenceSettings) -> str:
    """Why the numbers of the last cause, or of modes beside a joint's law, cannot be; empty where they can.

    Parameters
    ----------
    proposal
        A fitted cause.
    settings
        Errors by which a number must be wrong.
    """
    cause = proposal.fitted.hypothesis.causes[-1]
    if cause.axis is not None:
        return phases_too_large(cause.axis) or _far_modes(proposal.fitted.hypothesis, settings.farthest)
    if isinstance(cause.physics, ModePhysics):
        fitted = proposal.fitted.hypothesis
        return cause.physics.overdamped(complex(fitted.model.poles[-1])) or lost_mode(fitted)
    said: Callable[[Real, Real], str] | None = getattr(cause.physics, "impossible", None)
    if said is None:
        return ""
    steps = np.array([parameter.unit_step for parameter in cause.physics.parameters])
    return said(cause.values, settings.clear * _spread(proposal.fitted, cause) * steps)


def _far_modes(hypothesis: Hypothesis, farthest: float) -> str:
    """Which mode is too far from where the laboratory found it; empty where none is."""
    shape = hypothesis.shape
    off = shape.modal_rows(hypothesis.u)[: shape.believed, 0]
    if np.abs(off).max() <= farthest:
        return ""
    mode = int(np.argmax(np.abs(off)))
    before, after = (model.natural_frequencies[mode] for model in (shape.nominal, hypothesis.model))
    return f"the mode at {before:.4g} Hz would have to lie at {after:.4g} Hz"


def lost_mode(hypothesis: Hypothesis) -> str:
    """Which of the laboratory's modes is a resonance no more: it then stands for something else; empty where none.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis.
    """
    nominal = hypothesis.shape.nominal
    pairs = zip(nominal.damping_ratios, hypothesis.model.damping_ratios, nominal.natural_frequencies, strict=False)
    for before, now, frequency in pairs:
        if before <= MOST_DAMPED < now:
            return f"the mode at {frequency:.4g} Hz would have to be damped by {100 * now:.0f} %"
    return ""


def modes_not_seen(hypothesis: Hypothesis, lines: Sequence[WindowedSpectrum]) -> list[int]:
    """Places of the causes whose added mode is no resonance in a compared band, or just beside it.

    Other causes may have moved it there.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis with its causes.
    lines
        Windowed lines of the recordings.
    """
    low, high = min(one.frequencies[0] for one in lines), max(one.frequencies[-1] for one in lines)
    added = [(k, one.physics) for k, one in enumerate(hypothesis.causes) if isinstance(one.physics, ModePhysics)]
    poles = hypothesis.model.poles[hypothesis.shape.believed :]
    return [
        place
        for (place, physics), pole in zip(added, poles, strict=True)
        if physics.overdamped(complex(pole)) or not low / BESIDE <= abs(pole) / (2 * np.pi) <= BESIDE * high
    ]


def possible_gains(proposals: Sequence[Proposal[Fit]], settings: EvidenceSettings) -> list[Proposal[Fit]]:
    """Causes with possible numbers and the least evidence that counts, most evidence first.

    Parameters
    ----------
    proposals
        Fitted causes with their evidence.
    settings
        Thresholds of the evidence.
    """
    good = [one for one in proposals if one.evidence >= settings.least and not impossible(one, settings)]
    return sorted(good, key=lambda one: -one.evidence)


def plainest(proposals: Sequence[Proposal[Fit]], as_good: float) -> Proposal[Fit] | None:
    """The cause with most evidence, or the form of the same cause that is as good with fewer numbers.

    Parameters
    ----------
    proposals
        Fitted causes, most evidence first.
    as_good
        Evidence by which a form may be worse.
    """
    if not proposals:
        return None
    best = proposals[0]
    forms = [one for one in proposals if one.name == best.name and one.evidence > best.evidence - as_good]
    return min(forms, key=lambda one: (one.fitted.hypothesis.size, one.fitted.score))


def twins_of(best: Proposal[Fit], proposals: Sequence[Proposal[Fit]], share: float) -> list[Proposal[Fit]]:
    """The best law and those that differ from it by a linear spring and explain nearly as much, least odd modes first.

    The form of a law is never quite the true one, and a small share of its evidence may come from there. Such a
    difference does not decide between stiffness that is gained beyond a knee and stiffness that is missing within it:
    what they ask of the modes does.

    Parameters
    ----------
    best
        The proposal with most evidence.
    proposals
        All fitted causes.
    share
        Share of its evidence by which a twin may have less.
    """
    physics = best.fitted.hypothesis.causes[-1].physics
    twin = physics.twin if isinstance(physics, TwinPhysics) else ""
    near = [
        one
        for one in proposals
        if one.fitted.hypothesis.causes[-1].physics.name == twin and one.evidence > (1 - share) * best.evidence
    ]
    return sorted([best, *near], key=lambda one: one.fitted.deviation)


def strained(hypothesis: Hypothesis) -> bool:
    """Whether the data ask of a law what its name excludes.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis with its causes.
    """
    return bool(names_beyond(hypothesis))


def names_beyond(hypothesis: Hypothesis) -> tuple[str, ...]:
    """Names of the laws that the data ask for beyond the limits of those told, each once.

    At the limit of its name a law is as much the one as the other.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis with its causes.
    """
    names = [
        cause.physics.beyond
        for cause in hypothesis.laws
        if isinstance(cause.physics, LimitedPhysics)
        and cause.motion is not None
        and cause.physics.strained(cause.values, cause.motion)
    ]
    return tuple(dict.fromkeys(names))


def evidence_needed(current: Fit, base: Fit, settings: EvidenceSettings, *, own: bool = False) -> float:
    """Gain in score that a further cause needs: a small one may only mend the form of those found.

    Parameters
    ----------
    current
        The fit with the causes found so far.
    base
        The fit without any cause.
    settings
        Thresholds of the evidence.
    own
        Whether it is known to mend no law's form.
    """
    if current.hypothesis.laws:
        share = settings.small if own else settings.small_after_law
    else:
        share = settings.small_after_linear
    return max(settings.least, share * (base.score - current.score))


def mends_a_limit(
    proposal: Proposal[Fit],
    limits: Mapping[int, float],
    lines: Sequence[WindowedSpectrum],
    settings: EvidenceSettings,
) -> bool:
    """Whether the last cause is a mode that a clipped channel shows alone, small beside the evidence of the limit.

    Where the channel clips, its signal is put back from a prediction: what is wrong there looks like a resonance of
    this channel.

    Parameters
    ----------
    proposal
        A fitted cause.
    limits
        Evidence of each limit at which a channel clips, by the number of the response.
    lines
        Windowed lines of the recordings.
    settings
        Thresholds of the evidence.
    """
    fitted = proposal.fitted.hypothesis
    if not limits or not isinstance(fitted.causes[-1].physics, ModePhysics):
        return False
    size = np.sqrt(np.mean([np.mean(np.abs(one.measured) ** 2, axis=0) for one in lines], axis=0))
    power = np.abs(fitted.model.right[-1] / size) ** 2
    most = int(np.argmax(power))
    if power[most] < ALONE * power.sum():
        return False
    return proposal.evidence < settings.small * limits.get(most, 0.0)


def worth_it(
    proposal: Proposal[Fit],
    current: Fit,
    base: Fit,
    lines: list[WindowedSpectrum],
    settings: EvidenceSettings,
    *,
    own: bool = False,
    at_tip: bool = False,
) -> bool:
    """Whether a cause has enough evidence, in the misfit or in what the lab believes of the modes.

    A cause that gains in belief alone must take away most of what was odd about the modes. It must then also be more
    likely than that the lab was wrong in nothing but all dampings, or all frequencies.

    Parameters
    ----------
    proposal
        The cause, fitted until it rests.
    current, base
        Fits with the causes found so far, and without any.
    lines
        Windowed lines of the recordings.
    settings
        Thresholds of the evidence.
    own
        Whether the cause is known to mend no law's form.
    at_tip
        Whether the numbers of a joint inside are meant as counted in the tip's motion: no channel shows its own.
    """
    fitted, needed = proposal.fitted, evidence_needed(current, base, settings, own=own)
    if isinstance(fitted.hypothesis.causes[-1].physics, ModePhysics):
        if modes_not_seen(fitted.hypothesis, lines):
            return False
        needed = max(needed + _places_of_a_mode(fitted, lines), settings.stands_out * _numbers_in_a_mode(fitted, lines))
        clear = _mode_measured(fitted, settings.clear)
    else:
        clear = _measured(fitted, settings.clear, at_tip=at_tip)
        needed *= 1.0 if clear else settings.unclear
    if proposal.evidence < needed or not (clear or _is_missed(fitted, lines, needed)):
        return False
    if current.misfit - fitted.misfit > settings.least:
        return True
    odd = max(current.deviation - current.hypothesis.shape.size, 1.0)
    if current.deviation - fitted.deviation <= settings.mends_belief * odd:
        return False
    return proposal.evidence > _plainer_gain(current, lines)


def _plainer_gain(current: Fit, lines: list[WindowedSpectrum]) -> float:
    """What the score would gain if nothing were believed of the dampings, or of the frequencies."""
    shape = current.hypothesis.shape
    rows = shape.modal_rows(current.hypothesis.u)[: shape.believed]
    cost = float(np.log(2 * sum(one.measured.size for one in lines)))
    return max(float(np.sum(rows[:, k] ** 2 - cost)) for k in (0, 1))


def _places_of_a_mode(fitted: Fit, lines: list[WindowedSpectrum]) -> float:
    """Evidence that chance finds for the mode added last among all the places where one as narrow might lie."""
    pole = fitted.hypothesis.model.poles[-1]
    band = max(one.frequencies[-1] for one in lines) - min(one.frequencies[0] for one in lines)
    return 2 * float(np.log(max(band / (-float(pole.real) / np.pi), 1.0)))


def _numbers_in_a_mode(fitted: Fit, lines: list[WindowedSpectrum]) -> int:
    """Real numbers that were measured within the half-power band, ``2 zeta f``, of the mode added last."""
    pole = fitted.hypothesis.model.poles[-1]
    centre, half = abs(pole) / (2 * np.pi), -float(pole.real) / (2 * np.pi)
    inside = (np.abs(one.frequencies - centre) <= half for one in lines)
    return sum(2 * int(np.sum(which)) * one.measured.shape[1] for which, one in zip(inside, lines, strict=True))


def _is_missed(fitted: Fit, lines: list[WindowedSpectrum], needed: float) -> bool:
    """Whether modes, from where they are with a cause of the measuring chain, cannot make up for it.

    A delay is taken up by real modes to first order: its number has a wide error, and still it is not none.
    """
    hypothesis = fitted.hypothesis
    if not isinstance(hypothesis.causes[-1].physics, ChainPhysics):
        return False
    without = replace(hypothesis, causes=hypothesis.causes[:-1])
    return fit(lines, without, fitted.noises, iterations=TO_REST).score - fitted.score > needed


def _mode_measured(fitted: Fit, clear: float) -> bool:
    """Whether the damping of the mode added last stands out of its error: else no resonance was seen."""
    shape = fitted.hypothesis.shape
    place = shape.per_mode * (len(shape.nominal.poles) - 1) + 1
    return float(np.sqrt(np.maximum(fitted.covariance[place, place], 0.0))) * shape.lab.damping < 1 / clear


def _measured(fitted: Fit, clear: float, *, at_tip: bool) -> bool:
    """Whether any number of the last cause stands out of its own error: else the gain came from elsewhere."""
    cause = fitted.hypothesis.causes[-1]
    absent = cause.physics.start(fitted.hypothesis.shape.nominal) if isinstance(cause.physics, ChainPhysics) else None
    spread = _spread_at_tip(fitted) if at_tip else _spread(fitted, cause)
    stands_out = []
    for k, (parameter, error) in enumerate(zip(cause.physics.parameters, spread, strict=True)):
        if parameter.logarithmic:
            stands_out.append(error * parameter.unit_step < 1 / clear)
        else:
            zero = 0.0 if absent is None else float(absent[k])
            stands_out.append(abs(float(cause.values[k]) - zero) > clear * error * parameter.unit_step)
    return any(stands_out) if isinstance(cause.physics, ChainPhysics) else stands_out[0]


def _spread_at_tip(fitted: Fit) -> Real:
    """Standard errors of the coordinates of the last law's numbers, counted in the tip's motion, (n_parameters,)."""
    counted = replace(fitted, hypothesis=counted_at_tip(fitted.hypothesis))
    covariance = spread_with_scale(counted, len(fitted.hypothesis.causes) - 1)
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _spread(fitted: Fit, cause: Cause) -> Real:
    """Standard errors of the coordinates of the last cause's numbers, (n_parameters,)."""
    first = fitted.hypothesis.size - cause.size
    return np.sqrt(np.maximum(np.diag(fitted.covariance)[first : first + len(cause.values)], 0.0))
