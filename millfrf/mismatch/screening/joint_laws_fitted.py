"""Joint laws fitted in one round of the search, also level by level."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference.diagnosis import SCREENED, Candidate
from ..inference.search import Proposal, in_processes
from ..inference.settings import ScreeningSettings, Settings
from ..joints.joint_axis import JointAxis
from ..joints.joint_law import JointResponse
from ..models.cause import Cause, location_of
from ..models.first_motion import predict_lines
from ..models.fitting import Fit, fit, following_all, neglects_a_recording
from ..models.hypothesis import Hypothesis
from ..physics.protocol import JointPhysics, reported_name
from .joint_places import JointPlace, joint_places, motion_of
from .joint_starts import (
    fit_on_estimated_motion,
    moved_away_from_tip,
    started_at,
    with_flipped_signs,
    with_free_simulation,
    with_phases,
)
from .preloads import have_one_level, level
from .score_tests import Screened, screen_joints
from .whitened_residual import linear_floor

# another place is fitted further if its gain after a few steps is at least this share of the gain at the best place;
# largest number of places that are fitted further
NEARLY_AS_GOOD, MAX_PLACES = 0.7, 3

# a law is also fitted away from the tip if its evidence is at least this share of the evidence of the best law there
RIVAL_SHARE = 0.5


@dataclass(frozen=True)
class ScreenedLaws:
    """Laws screened at the likeliest place of a joint, best first, with candidates for the report and all places.

    ``places`` are the likeliest place and the equally likely ones.
    """

    screened: tuple[Screened, ...]
    candidates: tuple[Candidate, ...]
    places: tuple[JointPlace, ...] = ()

    @property
    def gain(self) -> float:
        """Gain in misfit of the best screened law; zero if there is no law."""
        return self.screened[0].gain if self.screened else 0.0


def screened_laws(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> ScreenedLaws:
    """Screen joint laws at the likeliest place; return none if its gain is insignificant."""
    floor = linear_floor(current, lines)
    places = joint_places(floor, current.hypothesis, settings.screening.place)
    axis, gain = places[0].axis, places[0].gain
    laws = laws_not_along(current.hypothesis, axis, laws)
    # with a single axis the gain is not tested: there is no choice of direction, and a broadband force only raises the
    # noise floor
    if not laws or (len(axis.entries) > 1 and gain < settings.screening.direction * len(lines)):
        return ScreenedLaws((), ())
    location = location_of(axis, current.hypothesis.model)
    screened = screen_joints(floor, current.hypothesis, axis, laws)
    candidates = [
        Candidate(reported_name(candidate.causes[0].physics), candidate.gain, SCREENED, location)
        for candidate in screened
    ]
    return ScreenedLaws(tuple(screened), tuple(candidates), places)


def law_on_estimated_motion(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> Proposal[Fit] | None:
    """Return the law that fits the estimated motion best, at the likeliest place, without a fit; None without a law.

    The fit of a law with a wrong form turns its joint away from the place that the measured motion shows.
    """
    screening = screened_laws(lines, current, laws, settings)
    if not screening.screened:
        return None
    cause = replace(screening.screened[0].causes[0], seen=None)
    started = fit(lines, current.hypothesis.with_cause(cause), current.noises, iterations=0)
    best = screening.candidates[0]
    return Proposal(best.name, best.location, started, current.score - started.score)


def laws_not_along(hypothesis: Hypothesis, axis: JointAxis, laws: Sequence[JointPhysics]) -> list[JointPhysics]:
    """Return the laws that no joint along nearly the same axis follows: two joints may follow the same law."""
    taken = {
        reported_name(cause.physics)
        for cause in hypothesis.laws
        if cause.axis is not None and cause.axis.nearly_along(axis)
    }
    return [law for law in laws if reported_name(law) not in taken]


def joint_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    screening: ScreenedLaws,
    settings: Settings,
    least: float,
    gained: float = 0.0,
) -> list[Proposal[Fit]]:
    """Fit the most promising laws, first to the estimated motion and then with free simulation."""
    largest_error = settings.verdict.most_of_response
    strong = neglects_a_recording(lines, current.hypothesis, largest_error)
    promising = _promising(screening, least, strong, settings.screening)
    driven = in_processes([partial(fit_on_estimated_motion, lines, current, start) for start in promising])
    driven = sorted(
        (driven_fit for driven_fit in driven if np.isfinite(driven_fit.score)), key=lambda driven_fit: driven_fit.score
    )
    good = _as_good(driven, current, gained, settings)
    if strong:
        good += _missing_kinds(good, driven, lambda driven_fit: driven_fit.hypothesis.causes[-1])
    simulated = in_processes(
        [partial(_simulated, lines, current, proposal, screening.places, settings) for proposal in good]
    )
    proposals = [proposal for proposal in simulated if proposal is not None]
    return proposals + _also_away_from_tip(lines, current, proposals, settings) if proposals else []


def _also_away_from_tip(
    lines: list[WindowedSpectrum], current: Fit, proposals: list[Proposal[Fit]], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit the best law at the tip and its rival once more, each away from the tip.

    If the true joint lies away from the tip, a law at the tip may gain less than modes that imitate it, and a wrong law
    may gain more than the true law.
    """
    best, *others = sorted(proposals, key=lambda proposal: -proposal.evidence)
    rivals = [
        proposal
        for proposal in others
        if proposal.name != best.name and proposal.evidence >= RIVAL_SHARE * best.evidence
    ]
    moved = in_processes(
        [partial(_away_from_tip, lines, current, proposal, settings) for proposal in [best, *rivals[:1]]]
    )
    return [proposal for proposal in moved if proposal is not None]


def _away_from_tip(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], settings: Settings
) -> Proposal[Fit] | None:
    """Fit a law that was found at the tip once more, away from the tip; return None if this gains too little."""
    least = max(settings.evidence.least, settings.screening.place * best.evidence)
    moved = moved_away_from_tip(lines, best.fitted, least, best.evidence)
    if moved is best.fitted:
        return None
    axis = moved.hypothesis.causes[-1].axis
    assert axis is not None
    # the location keeps the direction at the tip from which the fit started: readers understand it best
    location = {**best.location, **location_of(axis, moved.hypothesis.model)}
    return Proposal(best.name, location, moved, current.score - moved.score)


def _promising(screening: ScreenedLaws, least: float, strong: bool, limits: ScreeningSettings) -> list[Screened]:
    """Return the screened laws that are worth fitting, best first.

    For a strong effect they include at least one law that dissipates energy and one that does not.
    """
    enough = max(limits.least_law, least, limits.promising_law * screening.gain)
    promising = [candidate for candidate in screening.screened if candidate.gain > enough][: limits.most_laws]
    if not strong:
        return promising
    likely = [candidate for candidate in screening.screened if candidate.gain > limits.least_law]
    return promising + _missing_kinds(promising, likely, lambda hypothesis: hypothesis.causes[0])


def _as_good(driven: list[Fit], current: Fit, gained: float, settings: Settings) -> list[Fit]:
    """Select those laws fitted to the estimated motion that are good enough for a free simulation, best first.

    If all selected laws have the same name, the best law with a different name is added.
    """
    limits, gains = settings.screening, [current.score - driven_fit.score for driven_fit in driven]
    nearly = [limits.nearly * gain for gain in gains[:1]]
    enough = max([settings.evidence.least / 2, limits.rival * gained, *nearly])
    # forms of different causes may differ only by a linear spring: all equally good ones are simulated
    good = [
        driven_fit
        for place, (driven_fit, gain) in enumerate(zip(driven, gains, strict=True))
        if gain >= enough and (place < limits.most_simulated or gain > gains[0] - settings.evidence.least)
    ]
    names = {_name(proposal) for proposal in good}
    # forms of the same cause are no rivals: a law with a different name is needed
    rivals = [
        driven_fit
        for driven_fit, gain in zip(driven, gains, strict=True)
        if gain >= enough and _name(driven_fit) not in names
    ]
    return good + rivals[:1] if len(names) == 1 else good


def _name(fitted: Fit) -> str:
    """Return the name under which the last law of a fit is reported."""
    return reported_name(fitted.hypothesis.causes[-1].physics)


def _missing_kinds(chosen: list[Any], ranked: list[Any], cause_of: Callable[[Any], Cause]) -> list[Any]:
    """Return the best law of each kind, dissipating energy or not, of which no law was chosen.

    If a law shifts a resonance by more than its width, the estimated motion hardly shows the form of the law: a
    slipping joint looks like a softening spring.
    """
    kinds = {cause_of(candidate).law().loses_energy for candidate in chosen}
    more = []
    for proposal in ranked:
        kind = cause_of(proposal).law().loses_energy
        if kind not in kinds:
            more.append(proposal)
            kinds.add(kind)
    return more


def _simulated(
    lines: list[WindowedSpectrum], current: Fit, driven: Fit, places: Sequence[JointPlace], settings: Settings
) -> Proposal[Fit] | None:
    """Fit a law with free simulation after the fit to the estimated motion; None if it diverges."""
    law, gain, order = driven.hypothesis.causes[-1].physics, current.score - driven.score, list(places)
    fitted = with_free_simulation(lines, driven, gain, settings.evidence.least)
    largest_error = settings.verdict.most_of_response
    assert isinstance(law, JointPhysics)
    if np.isfinite(fitted.score) and neglects_a_recording(lines, fitted.hypothesis, largest_error):
        starts = [(fitted, places[0])] + [(started_at(lines, current, law, place.axis), place) for place in places[1:]]
        fitted, best_place = _best_place(
            lines, current, [(start, place) for start, place in starts if start is not None], settings
        )
        order = [best_place, *(place for place in places if place is not best_place)]
    if not np.isfinite(fitted.score):
        return None
    fitted = with_phases(lines, fitted, settings.evidence.least, current.score - fitted.score)
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    # a direction at the tip without equally likely places needs no list of places
    unique = len(order) == 1 and order[0].axis.scales is None
    alternatives = {} if unique else {"places": [place.content() for place in order]}
    location = {**location_of(axis, fitted.hypothesis.model), **alternatives}
    return Proposal(reported_name(law), location, fitted, current.score - fitted.score)


def _best_place(
    lines: list[WindowedSpectrum], current: Fit, starts: list[tuple[Fit, JointPlace]], settings: Settings
) -> tuple[Fit, JointPlace]:
    """Return the fit and the place at which a law explains most.

    ``starts`` are fits of a few steps, after which the gains at the places are still similar. The best places are
    therefore fitted further, to all recordings and with the best signs of the participations.
    """
    starts = sorted((start for start in starts if np.isfinite(start[0].score)), key=lambda start: start[0].score)
    enough = NEARLY_AS_GOOD * (current.score - starts[0][0].score)
    best = starts[:1] + [start for start in starts[1:MAX_PLACES] if current.score - start[0].score >= enough]
    largest_error, least = settings.verdict.most_of_response, settings.evidence.least
    fitted_on = [(following_all(lines, fitted, largest_error), place) for fitted, place in best]
    flipped = [(with_flipped_signs(lines, fitted, least), place) for fitted, place in fitted_on]
    return min(flipped, key=lambda start: start[0].score)


MAX_LAWS = 2  # most laws that are fitted level by level

# most steps of the refit to one recording, of each fit with one more level, and of the fit to all recordings
REFIT_STEPS, LEVEL_STEPS, FINAL_STEPS = 30, 12, 15

MAX_GROWTH = 100.0  # growth of a joint's motion beyond which a simulation has diverged


def laws_by_level(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit joint laws level by level: upwards from the weakest recording and downwards from the strongest recording.

    The best laws of the first recording are continued to all other recordings. Nothing is fitted if all levels are
    similar.
    """
    if have_one_level(lines, settings.search.levels_apart):
        return []
    ordered = sorted(lines, key=level)
    directions = ordered, ordered[::-1]
    first_fits = in_processes([partial(_at_first_level, way, current, laws, settings) for way in directions])
    tasks = [
        partial(_continued, lines, way, current, fitted)
        for way, end in zip(directions, first_fits, strict=True)
        for fitted in end
    ]
    return [result for result in in_processes(tasks) if result is not None]


def _at_first_level(
    sequence: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit laws to the first recording of a sequence alone, from the nominal modes; return those with most evidence."""
    start = replace(current.hypothesis, u=np.zeros_like(current.hypothesis.u))
    alone = fit(sequence[:1], start, iterations=REFIT_STEPS)
    if not np.isfinite(alone.score):
        return []
    proposals = joint_candidates(sequence[:1], alone, screened_laws(sequence[:1], alone, laws, settings), settings, 0.0)
    return sorted(proposals, key=lambda proposal: -proposal.evidence)[:MAX_LAWS]


def _continued(
    lines: list[WindowedSpectrum], sequence: list[WindowedSpectrum], current: Fit, first: Proposal[Fit]
) -> Proposal[Fit] | None:
    """Fit a law of the first recording again with each further recording added; return None if a fit diverges."""
    hypothesis = first.fitted.hypothesis
    for count in range(2, len(sequence)):
        hypothesis = fit(sequence[:count], with_motion(hypothesis, sequence[:count]), iterations=LEVEL_STEPS).hypothesis
    fitted = fit(lines, with_motion(hypothesis, lines), iterations=FINAL_STEPS, tolerance=10.0)
    if not np.isfinite(fitted.score):
        return None
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    location = {**first.location, **location_of(axis, fitted.hypothesis.model)}
    return Proposal(first.name, location, fitted, current.score - fitted.score)


def with_motion(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Hypothesis:
    """Adapt the tables of the last law to its predicted motion; return the unchanged hypothesis if that diverges."""
    last = hypothesis.causes[-1]
    assert last.motion is not None
    joints = [_recorded(predict_lines(hypothesis, recording).joints[-1], recording) for recording in lines]
    motion = motion_of(joints, last.motion.stiffness, (each.recording for each in lines))
    # the negated comparison also holds for NaN
    if not motion.reach <= MAX_GROWTH * last.motion.reach:
        return hypothesis
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], replace(last, motion=motion)))


def _recorded(joint: JointResponse, lines: WindowedSpectrum) -> JointResponse:
    """Return the motion of a joint without that in the padding."""
    n = len(joint.deflection) // lines.padded * len(lines.recording.force)
    return replace(joint, deflection=joint.deflection[:n], velocity=joint.velocity[:n])
