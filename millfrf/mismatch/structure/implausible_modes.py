"""Implausible modal parameters that may hide a linear cause, and modes that still move with the level."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..behaviour.behaviour_of_modes import FOLLOWS_LEVEL, Behaviour, behaviour_of
from ..inference.diagnosis import AcceptedCause, Candidate, Improvement, error_halved
from ..inference.process_pool import in_processes
from ..inference.search import Proposal, Round, Search, pruned
from ..inference.settings import VerdictSettings
from ..joints.joint_simulation import JointResponse
from ..models.fitting import Fit, fit, modes_are_odd, oddity_of_modes
from ..models.hypothesis import Cause, Hypothesis, predict_lines
from ..models.refinement import believed
from ..physics.protocol import ChainPhysics, answer_name
from ..screening.linear_causes_fitted import channel_of
from .acceptance import impossible
from .comparison import StructureComparison

PART, FEW, ROUGH_STEPS = 0.34, 1000, 4
"""Part of each recording, lines of it and steps at most on which causes are compared."""

FOLLOWED, FIRST_STEPS, STEPS = 2, 8, 30
"""Causes that are fitted to all that was recorded, steps at most of those fits, and of the two that decide."""

BROUGHT_BACK = 0.3
"""Share of what is odd about the modes that a cause must take away, and gain in score."""


def with_cause_of_odd_modes(comparison: StructureComparison, found: Search[Fit]) -> Search[Fit]:
    """The search with one more linear cause, where beside its causes modes look odd and that cause brings them back.

    Its last fit is replaced where one from the lab's own model is better, and causes that it makes needless go.

    Parameters
    ----------
    comparison
        Recordings, causes and thresholds.
    found
        Where the search ended.
    """
    after = _searched(comparison, found)
    gained = found.current.score - after.current.score
    # a cause that brings modes back has little evidence beside a law's, and pruning asks for more
    rested = len(after.accepted) == len(found.accepted) and gained > comparison.settings.evidence.least
    return pruned(comparison, after) if rested else after


def _searched(comparison: StructureComparison, found: Search[Fit]) -> Search[Fit]:
    """The search with the cause, or with a better last fit."""
    last = found.current
    if not found.accepted or not modes_are_odd(last):
        return found
    chains = [one for one in comparison.causes.values() if isinstance(one, ChainPhysics)]
    alone, begun = _begun(comparison.lines, last, chains)
    starts = [alone, *(one for pair in begun[:FOLLOWED] for one in pair)]
    tasks = [partial(fit, comparison.lines, one, last.noises, iterations=FIRST_STEPS) for one in starts]
    again, *fitted = in_processes(tasks)
    nearest = sorted((one for one in fitted if np.isfinite(one.score)), key=lambda one: one.score)[:1]
    tasks = [partial(fit, comparison.lines, one.hypothesis, one.noises, iterations=STEPS) for one in (again, *nearest)]
    again, *nearest = in_processes(tasks)
    found = _rested(comparison, found, again)
    if not nearest or not np.isfinite(nearest[0].score):
        return found
    return _with_cause(comparison, found, nearest[0])


def _with_cause(comparison: StructureComparison, found: Search[Fit], nearest: Fit) -> Search[Fit]:
    """The search with a cause that was fitted, if it can be and brings modes back; or with a better last fit."""
    best = _proposal(found.current, nearest)
    if impossible(best, comparison.settings.evidence):
        return found
    # what the modes become beside the cause may be better without it, too
    without = best.fitted.hypothesis.without(len(found.accepted))
    again = fit(comparison.lines, without, best.fitted.noises, iterations=STEPS)
    found = _rested(comparison, found, again)
    best = replace(best, evidence=found.current.score - best.fitted.score)
    odd, left = oddity_of_modes(found.current), oddity_of_modes(best.fitted)
    needed = max(comparison.settings.evidence.least, BROUGHT_BACK * odd)
    if not modes_are_odd(found.current) or best.evidence < needed or left > (1 - BROUGHT_BACK) * odd:
        return found
    told = Candidate(best.name, best.evidence, "fitted", best.location)
    return replace(
        found,
        steps=(*found.steps, best.fitted),
        accepted=(*found.accepted, best),
        rounds=(*found.rounds, Round((best,), best, (told,))),
    )


def _begun(
    lines: list[WindowedSpectrum], last: Fit, chains: list[ChainPhysics]
) -> tuple[Hypothesis, list[tuple[Hypothesis, ...]]]:
    """The lab's model with the causes so far, fitted roughly alone, and with each linear cause that gains, best first.

    Each cause begins twice: at the lab's model, and at the last fit, from which a valley may lead to it. A law that is
    far from linear is not followed from everywhere. What counts is the gain over the same start without the cause.
    Laws are driven by the motion of the last fit meanwhile: that takes less than a quarter of the time.
    """
    driven = _driven(last.hypothesis, lines)
    fresh = believed(driven)
    nominal = fresh.shape.nominal
    taken = {(cause.physics.name, cause.place) for cause in fresh.causes}
    more = [
        Cause(physics, physics.start(nominal), place)
        for physics in chains
        for place in physics.places(nominal)
        if (physics.name, place) not in taken
    ]
    rough, starts = [one.between(0.0, PART).thinned(FEW) for one in lines], (fresh, driven)
    tasks = [partial(fit, rough, fresh, last.noises, iterations=2 * ROUGH_STEPS)]
    for begun in starts:
        tasks += [partial(fit, rough, begun, last.noises, iterations=ROUGH_STEPS)]
        tasks += [partial(fit, rough, begun.with_cause(one), last.noises, iterations=ROUGH_STEPS) for one in more]
    alone, *fits = in_processes(tasks)
    half = len(more) + 1
    pairs = list(zip(fits[1:half], fits[half + 1 :], strict=True))
    without = fits[0], fits[half]

    def gain(pair: tuple[Fit, Fit]) -> float:
        gains = [less.score - one.score for less, one in zip(without, pair, strict=True)]
        return max((one for one in gains if np.isfinite(one)), default=-np.inf)

    # to follow a cause to its end takes longest: one that gains nothing roughly is not
    ranked = sorted((one for one in pairs if gain(one) > 0), key=gain, reverse=True)
    begun_with = [tuple(_free(one.hypothesis) for one in pair if np.isfinite(one.score)) for pair in ranked]
    return _free(alone.hypothesis), begun_with


def _driven(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Hypothesis:
    """The hypothesis with its laws driven by the motion that it predicts."""
    if not hypothesis.laws:
        return hypothesis
    predicted = [(one, predict_lines(hypothesis, one).joints) for one in lines]
    motions = (
        {one.recording.name: _at_samples(joints[k], one.padded) for one, joints in predicted}
        for k in range(len(hypothesis.laws))
    )
    causes = [one if one.axis is None else replace(one, seen=next(motions)) for one in hypothesis.causes]
    return replace(hypothesis, causes=tuple(causes))


def _at_samples(joint: JointResponse, count: int) -> tuple[Real, Real]:
    """Deflection and velocity of a joint at a record's samples, (count,) each: it may be simulated more often."""
    often = len(joint.deflection) // count
    return joint.deflection[::often], joint.velocity[::often]


def _free(hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis with laws that move as they make the structure move."""
    return replace(hypothesis, causes=tuple(replace(one, seen=None) for one in hypothesis.causes))


def _proposal(current: Fit, fitted: Fit) -> Proposal[Fit]:
    cause = fitted.hypothesis.causes[-1]
    return Proposal(answer_name(cause.physics), channel_of(cause), fitted, current.score - fitted.score)


def _rested(comparison: StructureComparison, found: Search[Fit], again: Fit) -> Search[Fit]:
    """The search with another fit of its last step, if that is better and can be."""
    told = replace(found.accepted[-1], fitted=again)
    if again.score >= found.current.score or impossible(told, comparison.settings.evidence):
        return found
    return replace(found, steps=(*found.steps[:-1], again))


LIMITS = frozenset(("clipping",))
"""Faults of a recording that depend on the level, too."""

SEEN_TO_STAY = 3.0
"""Standard errors, beside the causes, from which a mode's move without them would show again."""


def moved_by_level(answer: Hypothesis, causes: Sequence[AcceptedCause], behaviour: Behaviour | None) -> str:
    """How modes move with the level, in words, where nothing that would be told depends on it; else nothing.

    Every recording was refitted alone by a linear model, so the evidence needs no law and no library.

    Parameters
    ----------
    answer
        The hypothesis that would be told.
    causes
        Causes that would be told, faults among them.
    behaviour
        What modes do with the level; None: not looked at.
    """
    if behaviour is None or not behaviour.follows_level:
        return ""
    if answer.laws or any(one.name in LIMITS for one in causes):
        return ""
    return f"{behaviour.sentence} No linear model does that, so the answer is not whole"


def stay_beside(answer: Hypothesis, behaviour: Behaviour | None, recordings: Sequence[WindowedSpectrum]) -> bool:
    """Whether modes that move without the causes are seen to stay with them.

    A rotor's coupling or a further mode that is missing shifts the modes of a refit, too, as far as levels differ in
    their speeds and spectra.

    Parameters
    ----------
    answer
        The hypothesis that would be told, with linear causes alone.
    behaviour
        What modes do without any cause; None: not looked at.
    recordings
        Windowed spectra of the recordings.
    """
    return behaviour is not None and seen_to_stay(behaviour, behaviour_of(answer, recordings))


def seen_to_stay(before: Behaviour, after: Behaviour) -> bool:
    """Whether no mode moves in the second behaviour, and each that moves in the first would show that there.

    Parameters
    ----------
    before, after
        What modes do with the level, without causes and with them.
    """
    if after.follows_level or len(after.modes) < len(before.modes):
        return False
    for moved, again in zip(before.modes, after.modes, strict=False):
        if moved.family not in FOLLOWS_LEVEL:
            continue
        frequency = moved.p_values[0] <= moved.p_values[1]
        change, error = (moved.shift, again.shift_error) if frequency else (moved.gain, again.gain_error)
        if SEEN_TO_STAY * error > abs(change):
            return False
    return True


def stands_beside_moving_modes(gain: Improvement, settings: VerdictSettings) -> bool:
    """Whether linear causes leave a quarter, at most, of the power that a plain refit leaves above the noise.

    Where modes move with the level a linear cause that gains little may only mend what the law that is missing does.

    Parameters
    ----------
    gain
        Errors on the recording held out.
    settings
        Thresholds of the verdict.

    Examples
    --------
    >>> little = Improvement("mid", 0.18, 0.0362, 0.0361, 0.0352, 0.0003, (0.1, 0.3))
    >>> stands_beside_moving_modes(little, VerdictSettings())
    False
    """
    return error_halved(replace(gain, against="refitted"), settings)
