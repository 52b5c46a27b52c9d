"""One law in several joints at once, tried before the causes are searched for one after the other."""

from dataclasses import replace

import numpy as np

from ..inference.diagnosis import Candidate
from ..inference.search import Progress, Proposal, Search, continued, search
from ..models.cause import location_of
from ..models.fitting import Fit, fit
from ..physics.protocol import JointPhysics, reported_name
from ..screening.laws_at_points import driven_points, laws_at_points
from .acceptance import impossible
from .comparison import PRUNING_STEPS, StructureComparison
from .rounds import StructureRound
from .structured_residual import remainder_of


def search_with_laws_together(comparison: StructureComparison, base: Fit, progress: Progress) -> Search[Fit]:
    """Return the search from a law in all driven joints if it leaves only noise, otherwise the likelier of both.

    To be preferred to causes that were added one after the other, the law in all joints needs the evidence of a
    further cause.

    Parameters
    ----------
    comparison
        Recordings, causes and thresholds of the diagnosis.
    base
        Fit of the modal parameters alone.
    progress
        Called with a short text when a new stage begins.
    """
    together = _laws_together(comparison, base, progress)
    if together is not None and _leaves_noise(comparison, together):
        return together
    single = search(comparison, base, progress)
    if together is None:
        return single
    better = together.current.score < single.current.score - comparison.needed(single.current, base)
    best, other = (together, single) if better else (single, together)
    return replace(best, rejected=(*best.rejected, *other.candidates))


def _leaves_noise(comparison: StructureComparison, result: Search[Fit]) -> bool:
    limits, remainder = comparison.settings.verdict, remainder_of(result.current.hypothesis, comparison.lines)
    return remainder.noise_like(limits.noise_like)


def _laws_together(comparison: StructureComparison, base: Fit, progress: Progress) -> Search[Fit] | None:
    """Return a search that began with a law in all driven joints; None if no such law is likely."""
    laws = [cause for cause in comparison.causes.values() if isinstance(cause, JointPhysics)]
    structured = comparison.modes_move or not comparison.before.noise_like(comparison.settings.verdict.noise_like)
    if not (laws and structured and driven_points(base.hypothesis) > 1):
        return None
    progress("one law in several joints")
    fits = laws_at_points(comparison.lines, base, laws, comparison.settings.screening)
    likely = [fitted for fitted in fits if fitted.score < base.score - comparison.needed(base, base)]
    for place in range(len(likely)):
        start = _started_with(comparison, base, likely[place:])
        if start is not None:
            return continued(comparison, start, progress)
    return None


def _started_with(comparison: StructureComparison, base: Fit, fits: list[Fit]) -> Search[Fit] | None:
    """Return a search that has accepted the laws of the first fit, one for each joint; None if they are impossible.

    The evidence of each law is the score that the fit loses without it.
    """
    (best, *others), evidence = fits, comparison.settings.evidence
    first, count = len(base.hypothesis.causes), len(best.hypothesis.causes)
    near = [fitted for fitted in others if fitted.score < best.score + evidence.as_good]
    names = tuple(reported_name(rival.hypothesis.causes[-1].physics) for rival in near)
    steps, accepted, rounds = [best], list[Proposal[Fit]](), list[StructureRound]()
    for place in range(count - 1, first, -1):
        steps.insert(0, _refitted(comparison, steps[0], place))
    for place, step in zip(range(first, count), steps, strict=True):
        cause = step.hypothesis.causes[-1]
        less = steps[-2] if place == count - 1 else _refitted(comparison, best, place)
        if cause.axis is None or not np.isfinite(step.score):
            return None
        location = location_of(cause.axis, step.hypothesis.model)
        proposal = Proposal(reported_name(cause.physics), location, step, less.score - best.score)
        if impossible(proposal, evidence):
            return None
        accepted.append(proposal)
        candidate = Candidate(proposal.name, proposal.evidence, "fitted", dict(location))
        rounds.append(StructureRound((proposal,), proposal, (candidate,), names))
    return Search((base, *steps), tuple(accepted), tuple(rounds))


def _refitted(comparison: StructureComparison, fitted: Fit, place: int) -> Fit:
    """Fit again without one cause."""
    return fit(comparison.lines, fitted.hypothesis.without(place), fitted.noises, iterations=PRUNING_STEPS)
