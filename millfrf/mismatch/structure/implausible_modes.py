"""Implausible modal parameters that may hide a linear cause, and modes that still move with the level."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..behaviour.behaviour_of_modes import FOLLOWS_LEVEL, Behaviour
from ..behaviour.behaviour_of_recordings import behaviour_of
from ..inference.diagnosis import AcceptedCause, Candidate, Improvement, error_halved
from ..inference.search import Proposal, Round, Search, in_processes, pruned
from ..inference.settings import VerdictSettings
from ..joints.joint_law import JointResponse
from ..models.cause import Cause
from ..models.first_motion import predict_lines
from ..models.fitting import (
    BEGINNING,
    Fit,
    at_nominal_modes,
    excess_of_modes,
    fit,
    fit_of_beginning,
    modes_are_implausible,
)
from ..models.hypothesis import Hypothesis
from ..physics.protocol import ChainPhysics, reported_name
from ..physics.wider_forms import families
from ..screening.linear_causes_fitted import channel_of
from .acceptance import impossible
from .comparison import StructureComparison

# number of lines and number of steps for the rough comparison of causes
ROUGH_LINES, ROUGH_STEPS = 1000, 4

# number of causes fitted with free simulation, and most steps of these fits; number of final fits with a cause, and
# their most steps
BEST_CAUSES, FIRST_STEPS, NEAREST, FINAL_STEPS = 2, 8, 2, 30

RESTORED = 0.3  # share of the implausible modal deviation that a cause must remove, and that its evidence must reach


def with_cause_of_implausible_modes(comparison: StructureComparison, search: Search[Fit]) -> Search[Fit]:
    """Add one more linear cause if the modes are implausible and this cause restores them.

    The last fit is replaced if a fit from the nominal model is better, and causes that became redundant are removed.
    """
    after = _searched(comparison, search)
    gained = search.current.score - after.current.score
    # after a new cause nothing is pruned, as pruning requires more evidence than such a cause has after a law
    rested = len(after.accepted) == len(search.accepted) and gained > comparison.settings.evidence.least
    return pruned(comparison, after) if rested else after


def _searched(comparison: StructureComparison, search: Search[Fit]) -> Search[Fit]:
    """Return the search with the linear cause that restores the modes, or with a better last fit."""
    last = search.current
    if not search.accepted or not modes_are_implausible(last):
        return search
    chains = [cause for cause in comparison.causes.values() if isinstance(cause, ChainPhysics)]
    alone, ranked_starts = _starts_with_causes(comparison.lines, last, chains)
    starts = [alone, *(start for pair in ranked_starts[:BEST_CAUSES] for start in pair)]
    first_fit = partial(fit_of_beginning, comparison.lines, noises=last.noises, iterations=FIRST_STEPS)
    refitted, *fitted = in_processes([partial(first_fit, start) for start in starts])
    # causes of two channels may be nearly equally likely until their fits have converged
    nearest = sorted(
        (candidate for candidate in fitted if np.isfinite(candidate.score)), key=lambda candidate: candidate.score
    )[:NEAREST]
    tasks = [
        partial(fit, comparison.lines, candidate.hypothesis, candidate.noises, iterations=FINAL_STEPS)
        for candidate in (refitted, *nearest)
    ]
    refitted, *nearest = in_processes(tasks)
    nearest.sort(key=lambda candidate: candidate.score if np.isfinite(candidate.score) else np.inf)
    search = _with_better_fit(comparison, search, refitted)
    if not nearest or not np.isfinite(nearest[0].score):
        return search
    return _with_cause(comparison, search, nearest[0])


def _with_cause(comparison: StructureComparison, search: Search[Fit], nearest: Fit) -> Search[Fit]:
    """Return the search with a fitted cause if it is possible and restores the modes, or with a better last fit."""
    best = _proposal(search.current, nearest)
    if impossible(best, comparison.settings.evidence):
        return search
    # the modes that were fitted with the cause may also give a better fit without it
    without = best.fitted.hypothesis.without(len(search.accepted))
    refitted = fit(comparison.lines, without, best.fitted.noises, iterations=FINAL_STEPS)
    search = _with_better_fit(comparison, search, refitted)
    best = replace(best, evidence=search.current.score - best.fitted.score)
    excess_before, excess_after = excess_of_modes(search.current), excess_of_modes(best.fitted)
    needed = max(comparison.settings.evidence.least, RESTORED * excess_before)
    if (
        not modes_are_implausible(search.current)
        or best.evidence < needed
        or excess_after > (1 - RESTORED) * excess_before
    ):
        return search
    candidate = Candidate(best.name, best.evidence, "fitted", best.location)
    return replace(
        search,
        steps=(*search.steps, best.fitted),
        accepted=(*search.accepted, best),
        rounds=(*search.rounds, Round((best,), best, (candidate,))),
    )


def _starts_with_causes(
    lines: list[WindowedSpectrum], last: Fit, chains: list[ChainPhysics]
) -> tuple[Hypothesis, list[tuple[Hypothesis, ...]]]:
    """Return rough fits: one with the accepted causes, and two for each further linear cause that gains, best first.

    Each further cause is fitted from the nominal modes and from the modes of the last fit, as a strongly nonlinear law
    does not converge from every start. Its gain is the difference to the fit from the same start without it. The laws
    are driven by the motion of the last fit, which takes less than a quarter of the time of a free simulation.
    """
    driven = _with_predicted_motion(last.hypothesis, lines)
    fresh = at_nominal_modes(driven)
    nominal = fresh.shape.nominal
    taken = {(cause.physics.name, cause.place) for cause in fresh.causes}
    added_causes = [
        Cause(physics, physics.start(nominal), place)
        for physics in chains
        for place in physics.places(nominal)
        if (physics.name, place) not in taken
    ]
    rough, starts = [recording.between(0.0, BEGINNING).thinned(ROUGH_LINES) for recording in lines], (fresh, driven)
    tasks = [partial(fit, rough, fresh, last.noises, iterations=2 * ROUGH_STEPS)]
    for start in starts:
        tasks += [partial(fit, rough, start, last.noises, iterations=ROUGH_STEPS)]
        tasks += [
            partial(fit, rough, start.with_cause(cause), last.noises, iterations=ROUGH_STEPS) for cause in added_causes
        ]
    alone, *fits = in_processes(tasks)
    half = len(added_causes) + 1
    pairs = list(zip(fits[1:half], fits[half + 1 :], strict=True))
    without = fits[0], fits[half]

    def gain(pair: tuple[Fit, Fit]) -> float:
        gains = [less.score - fitted.score for less, fitted in zip(without, pair, strict=True)]
        return max((value for value in gains if np.isfinite(value)), default=-np.inf)

    # the final fits take longest: a cause without a rough gain is not fitted
    ranked = sorted((pair for pair in pairs if gain(pair) > 0), key=gain, reverse=True)
    begun_with = [
        tuple(_simulated_freely(start.hypothesis) for start in pair if np.isfinite(start.score)) for pair in ranked
    ]
    return _simulated_freely(alone.hypothesis), begun_with


def _with_predicted_motion(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Hypothesis:
    """Return the hypothesis with its laws driven by the motion that it predicts."""
    if not hypothesis.laws:
        return hypothesis
    predicted = [(recording, predict_lines(hypothesis, recording).joints) for recording in lines]
    motions = (
        {recording.recording.name: _at_samples(joints[k], recording.padded) for recording, joints in predicted}
        for k in range(len(hypothesis.laws))
    )
    causes = [cause if cause.axis is None else replace(cause, seen=next(motions)) for cause in hypothesis.causes]
    return replace(hypothesis, causes=tuple(causes))


def _at_samples(joint: JointResponse, count: int) -> tuple[Real, Real]:
    """Return deflection and velocity of a joint at the samples of a record; the simulation may have more samples."""
    oversampling = len(joint.deflection) // count
    return joint.deflection[::oversampling], joint.velocity[::oversampling]


def _simulated_freely(hypothesis: Hypothesis) -> Hypothesis:
    """Return the hypothesis with laws that are simulated freely."""
    return replace(hypothesis, causes=tuple(replace(cause, seen=None) for cause in hypothesis.causes))


def _proposal(current: Fit, fitted: Fit) -> Proposal[Fit]:
    cause = fitted.hypothesis.causes[-1]
    return Proposal(reported_name(cause.physics), channel_of(cause), fitted, current.score - fitted.score)


def _with_better_fit(comparison: StructureComparison, search: Search[Fit], refitted: Fit) -> Search[Fit]:
    """Return the search with ``refitted`` as its last step if this fit is better and its numbers are possible."""
    proposal = replace(search.accepted[-1], fitted=refitted)
    if refitted.score >= search.current.score or impossible(proposal, comparison.settings.evidence):
        return search
    return replace(search, steps=(*search.steps[:-1], refitted))


LEVEL_FAULTS = frozenset(("clipping",))  # faults of a recording that depend on the level, too

# a mode's change without the causes must exceed this number of the standard errors of its change with the causes
CLEAR_CHANGE = 3.0


def moved_by_level(answer: Hypothesis, causes: Sequence[AcceptedCause], behaviour: Behaviour | None) -> str:
    """Return a sentence if modes change with the level but no reported cause does; else an empty text.

    Each recording was refitted alone by a linear model, so that this result does not depend on the library of laws.

    ``behaviour``: change of the modes with the level; None if it was not determined.
    """
    if behaviour is None or not behaviour.follows_level:
        return ""
    if answer.laws or any(cause.name in LEVEL_FAULTS for cause in causes):
        return ""
    if behaviour.family == "uncertain":
        return f"{behaviour.sentence} The answer may be incomplete"
    return f"{behaviour.sentence} No linear model does that, so the answer is incomplete"


def behaviour_given_drifts(behaviour: Behaviour, answer: Hypothesis) -> Behaviour:
    """Return the behaviour by level, or that nothing can be said of it where a stiffness changes in each recording.

    A linear refit of a recording then gives modes of some instant, which depends on how the force sweeps.
    """
    drifts = bool(answer.laws) and all(families(cause.law()) == "t" for cause in answer.laws)
    if not (drifts and behaviour.follows_level):
        return behaviour
    sentence = (
        "Linear refits of single recordings differ, but the stiffness changes within each of them: no change of the "
        "modes with the level can be read from such refits."
    )
    return replace(behaviour, family="cannot tell", sentence=sentence, modes=())


def modes_stay_with_causes(
    answer: Hypothesis, behaviour: Behaviour | None, recordings: Sequence[WindowedSpectrum]
) -> bool:
    """Return whether modes that change without the linear causes are constant with them.

    The coupling of a rotor or a missing mode also changes the refitted modes if the levels differ in speed or spectrum.

    ``behaviour``: change of the modes without any cause; None if it was not determined.
    """
    return behaviour is not None and shows_no_move(behaviour, behaviour_of(answer, recordings))


def shows_no_move(before: Behaviour, after: Behaviour) -> bool:
    """Return whether no mode changes with the causes, although the changes without the causes would be significant."""
    if after.follows_level or len(after.modes) < len(before.modes):
        return False
    for trend_before, trend_after in zip(before.modes, after.modes, strict=False):
        if trend_before.family not in FOLLOWS_LEVEL:
            continue
        frequency = trend_before.p_values[0] <= trend_before.p_values[1]
        change, error = (
            (trend_before.shift, trend_after.shift_error) if frequency else (trend_before.gain, trend_after.gain_error)
        )
        if CLEAR_CHANGE * error > abs(change):
            return False
    return True


def halves_refitted_error(gain: Improvement, settings: VerdictSettings) -> bool:
    """Return whether the residual power above noise is at most a quarter of the power that refitted modes leave.

    If modes change with the level, a linear cause that gains less may only correct the effect of the missing law.

    Examples
    --------
    >>> little = Improvement("mid", 0.18, 0.0362, 0.0361, 0.0352, 0.0003, (0.1, 0.3))
    >>> halves_refitted_error(little, VerdictSettings())
    False
    """
    return error_halved(replace(gain, against="refitted"), settings)
