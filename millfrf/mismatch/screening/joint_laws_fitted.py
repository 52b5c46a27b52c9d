"""Joint laws fitted in one round of the search, level by level."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference.diagnosis import Candidate
from ..inference.process_pool import in_processes
from ..inference.search import Proposal
from ..inference.settings import ScreeningSettings, Settings
from ..models.fitting import Fit, fit
from ..models.hypothesis import Cause, Hypothesis, location_of, predict_lines
from ..models.refinement import following_all, gives_one_up
from ..physics.protocol import JointPhysics, answer_name
from .joint_places import JointPlace, joint_places, motion_of
from .joint_starts import begun_at, driven_by_what_was_seen, freed, moved_inside, with_phases, with_turned_signs
from .score_tests import Screened, screen_joints
from .whitened_residual import linear_floor

NEARLY_AS_GOOD, MOST_FOLLOWED = 0.7, 3
"""Share of the best place's gain after a few steps from which a law is followed on at a place, and how many are."""

RIVAL = 0.5
"""Share of the best law's evidence at the tip from which another law is tried inside, too."""


@dataclass(frozen=True)
class SightedLaws:
    """Laws at the likeliest place of a joint, best first, what a diagnosis tells about them, and places as likely."""

    screened: tuple[Screened, ...]
    weighed: tuple[Candidate, ...]
    places: tuple[JointPlace, ...] = ()

    @property
    def gain(self) -> float:
        """Screened gain of the best law, in misfit; zero where there is none."""
        return self.screened[0].gain if self.screened else 0.0


def sighted_laws(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> SightedLaws:
    """Screen joint laws at the place that stands out; nothing where none does.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit with the causes found so far.
    laws
        Laws from the library that are screened.
    settings
        Thresholds of the diagnosis.
    """
    taken = {answer_name(cause.physics) for cause in current.hypothesis.causes}
    laws = [law for law in laws if answer_name(law) not in taken]
    floor = linear_floor(current, lines)
    places = joint_places(floor, current.hypothesis, settings.screening.place)
    axis, gain = places[0].axis, places[0].gain
    # along a single axis there is no direction to stand out, and a broad force looks like a higher floor
    if not laws or (len(axis.entries) > 1 and gain < settings.screening.direction * len(lines)):
        return SightedLaws((), ())
    location = location_of(axis, current.hypothesis.model)
    screened = screen_joints(floor, current.hypothesis, axis, laws)
    weighed = [Candidate(answer_name(one.causes[0].physics), one.gain, "screened", location) for one in screened]
    return SightedLaws(tuple(screened), tuple(weighed), places)


def joint_candidates(
    lines: list[WindowedSpectrum],
    current: Fit,
    sighted: SightedLaws,
    settings: Settings,
    least: float,
    gained: float = 0.0,
) -> list[Proposal[Fit]]:
    """Fit the laws that promise most.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without a further law.
    sighted
        Laws to try, as they were screened, best first.
    settings
        Thresholds of the diagnosis.
    least
        Screened gain from which a law is fitted.
    gained
        Score that the best linear cause gains.
    """
    most = settings.verdict.most_of_response
    strong = gives_one_up(lines, current.hypothesis, most)
    promising = _promising(sighted, least, strong, settings.screening)
    driven = in_processes([partial(driven_by_what_was_seen, lines, current, one) for one in promising])
    driven = sorted((one for one in driven if np.isfinite(one.score)), key=lambda one: one.score)
    near = _as_good(driven, current, gained, settings)
    if strong:
        near += _missing_kinds(near, driven, lambda one: one.hypothesis.causes[-1])
    simulated = in_processes([partial(_simulated, lines, current, one, sighted.places, settings) for one in near])
    found = [one for one in simulated if one is not None]
    return found + _inside_too(lines, current, found, settings) if found else []


def _inside_too(
    lines: list[WindowedSpectrum], current: Fit, found: list[Proposal[Fit]], settings: Settings
) -> list[Proposal[Fit]]:
    """The best law at the tip, and its rival, once more inside, where the data tell the one place from the other.

    At the tip a law may gain less than modes that imitate it: what it then lacks is its place. Its rival lacks the
    same, and at the wrong place the wrong one of the two may gain more.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit without the law.
    found
        Laws that were found.
    settings
        Thresholds of the diagnosis.
    """
    best, *others = sorted(found, key=lambda one: -one.evidence)
    near = [one for one in others if one.name != best.name and one.evidence >= RIVAL * best.evidence]
    tried = in_processes([partial(_inside, lines, current, one, settings) for one in [best, *near[:1]]])
    return [one for one in tried if one is not None]


def _inside(
    lines: list[WindowedSpectrum], current: Fit, best: Proposal[Fit], settings: Settings
) -> Proposal[Fit] | None:
    """A law at the tip once more, inside; None where that gains too little."""
    least = max(settings.evidence.least, settings.screening.place * best.evidence)
    inside = moved_inside(lines, best.fitted, least, best.evidence)
    if inside is best.fitted:
        return None
    axis = inside.hypothesis.causes[-1].axis
    assert axis is not None
    # the direction along which it was found at the tip still says most to a reader
    location = {**best.location, **location_of(axis, inside.hypothesis.model)}
    return Proposal(best.name, location, inside, current.score - inside.score)


def _promising(sighted: SightedLaws, least: float, strong: bool, limits: ScreeningSettings) -> list[Screened]:
    """Screened laws that are fitted, best first; of a strong effect at least one of each kind."""
    enough = max(limits.least_law, least, limits.promising_law * sighted.gain)
    chosen = [one for one in sighted.screened if one.gain > enough][: limits.most_laws]
    if not strong:
        return chosen
    likely = [one for one in sighted.screened if one.gain > limits.least_law]
    return chosen + _missing_kinds(chosen, likely, lambda one: one.causes[0])


def _as_good(driven: list[Fit], current: Fit, gained: float, settings: Settings) -> list[Fit]:
    """Laws fitted to the motion seen, best first, that are simulated freely."""
    limits, gains = settings.screening, [current.score - one.score for one in driven]
    nearly = [limits.nearly * gain for gain in gains[:1]]
    enough = max([settings.evidence.least / 2, limits.rival * gained, *nearly])
    # forms of different causes may differ by a linear spring alone: all that are as good are simulated
    near = [
        one
        for place, (one, gain) in enumerate(zip(driven, gains, strict=True))
        if gain >= enough and (place < limits.most_simulated or gain > gains[0] - settings.evidence.least)
    ]
    names = {_name(one) for one in near}
    # of two forms of one cause neither is the other's rival
    rivals = [one for one, gain in zip(driven, gains, strict=True) if gain >= enough and _name(one) not in names]
    return near + rivals[:1] if len(names) == 1 else near


def _name(fitted: Fit) -> str:
    """Name under which the last law of a fit is told."""
    return answer_name(fitted.hypothesis.causes[-1].physics)


def _missing_kinds(chosen: list[Any], ranked: list[Any], cause_of: Callable[[Any], Cause]) -> list[Any]:
    """The first of the ranked whose law loses energy, and whose law loses none, where none of its kind was chosen.

    Where a law moves a resonance by more than its width, the motion that was seen says little of its form: a joint that
    slips softens, and so does a spring.
    """
    kinds = {cause_of(one).law().loses_energy for one in chosen}
    more = []
    for one in ranked:
        kind = cause_of(one).law().loses_energy
        if kind not in kinds:
            more.append(one)
            kinds.add(kind)
    return more


def _simulated(
    lines: list[WindowedSpectrum], current: Fit, near: Fit, places: Sequence[JointPlace], settings: Settings
) -> Proposal[Fit] | None:
    """The law of a driven fit, now free to move as it makes the structure move; None if that runs away."""
    law, gained, order = near.hypothesis.causes[-1].physics, current.score - near.score, list(places)
    fitted = freed(lines, near, gained)
    most = settings.verdict.most_of_response
    assert isinstance(law, JointPhysics)
    if np.isfinite(fitted.score) and gives_one_up(lines, fitted.hypothesis, most):
        at = [(fitted, places[0])] + [(begun_at(lines, current, law, one.axis), one) for one in places[1:]]
        fitted, taken = _best_followed(lines, current, [(one, place) for one, place in at if one is not None], settings)
        order = [taken, *(one for one in places if one is not taken)]
    if not np.isfinite(fitted.score):
        return None
    fitted = with_phases(lines, fitted, settings.evidence.least, current.score - fitted.score)
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    # a direction at the tip that nothing else comes near to says all
    alone = len(order) == 1 and order[0].axis.scales is None
    told = {} if alone else {"places": [one.told() for one in order]}
    location = {**location_of(axis, fitted.hypothesis.model), **told}
    return Proposal(answer_name(law), location, fitted, current.score - fitted.score)


def _best_followed(
    lines: list[WindowedSpectrum], current: Fit, begun: list[tuple[Fit, JointPlace]], settings: Settings
) -> tuple[Fit, JointPlace]:
    """The law at the place where it explains most once it follows all recordings, with either sign of each part.

    After a few steps the places are nearly alike, and their order is chance: the best of them are followed on.
    """
    begun = sorted((one for one in begun if np.isfinite(one[0].score)), key=lambda one: one[0].score)
    enough = NEARLY_AS_GOOD * (current.score - begun[0][0].score)
    near = begun[:1] + [one for one in begun[1:MOST_FOLLOWED] if current.score - one[0].score >= enough]
    most, least = settings.verdict.most_of_response, settings.evidence.least
    followed = [(following_all(lines, fitted, most), place) for fitted, place in near]
    turned = [(with_turned_signs(lines, fitted, least), place) for fitted, place in followed]
    return min(turned, key=lambda one: one[0].score)


CARRIED = 2
"""Laws that are carried from one recording to the others at most."""

FROM_NOMINAL, PER_LEVEL, TO_END = 30, 12, 15
"""Steps at most of the refit of one recording, of each level that joins, and of the fit to all of them."""

LONGEST_REACH = 100.0
"""Growth of a joint's motion beyond which a simulation has run away."""


def laws_by_level(
    lines: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Fit joint laws to the weakest and the strongest recording, and carry the best to all others.

    Where all levels are alike, there is nothing to carry.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        The fit of all recordings with the causes found so far.
    laws
        Laws from the library.
    settings
        Thresholds of the diagnosis.
    """
    order = np.argsort([_level(one) for one in lines])
    ordered = [lines[k] for k in order]
    if _level(ordered[-1]) < settings.search.levels_apart * _level(ordered[0]):
        return []
    ways = ordered, ordered[::-1]
    ends = in_processes([partial(_at_the_end, way, current, laws, settings) for way in ways])
    tasks = [partial(_carried, lines, way, current, one) for way, end in zip(ways, ends, strict=True) for one in end]
    return [one for one in in_processes(tasks) if one is not None]


def _at_the_end(
    way: list[WindowedSpectrum], current: Fit, laws: list[JointPhysics], settings: Settings
) -> list[Proposal[Fit]]:
    """Laws fitted to the first recording of a way alone, from the lab's modes, those with most evidence first."""
    start = replace(current.hypothesis, u=np.zeros_like(current.hypothesis.u))
    alone = fit(way[:1], start, iterations=FROM_NOMINAL)
    if not np.isfinite(alone.score):
        return []
    found = joint_candidates(way[:1], alone, sighted_laws(way[:1], alone, laws, settings), settings, 0.0)
    return sorted(found, key=lambda one: -one.evidence)[:CARRIED]


def _carried(
    lines: list[WindowedSpectrum], way: list[WindowedSpectrum], current: Fit, first: Proposal[Fit]
) -> Proposal[Fit] | None:
    """A law of a way's first recording fitted to one more level after the other; None where it runs away."""
    reached = first.fitted.hypothesis
    for count in range(2, len(way)):
        reached = fit(way[:count], _with_motion(reached, way[:count]), iterations=PER_LEVEL).hypothesis
    fitted = fit(lines, _with_motion(reached, lines), iterations=TO_END, tolerance=10.0)
    if not np.isfinite(fitted.score):
        return None
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    location = {**first.location, **location_of(axis, fitted.hypothesis.model)}
    return Proposal(first.name, location, fitted, current.score - fitted.score)


def _with_motion(hypothesis: Hypothesis, lines: list[WindowedSpectrum]) -> Hypothesis:
    """The hypothesis whose last law reaches as far as its joint now moves; as it was where that runs away."""
    last = hypothesis.causes[-1]
    assert last.motion is not None
    joints = [predict_lines(hypothesis, one).joints[-1] for one in lines]
    motion = motion_of(joints, last.motion.stiffness)
    # NaN is no smaller
    if not motion.reach <= LONGEST_REACH * last.motion.reach:
        return hypothesis
    return replace(hypothesis, causes=(*hypothesis.causes[:-1], replace(last, motion=motion)))


def _level(lines: WindowedSpectrum) -> float:
    """Root mean square of what drives the recording in the compared band."""
    # not `BandRecording.level`: it counts force outside the band, which says little of how far these modes move
    return float(np.sqrt(np.mean(np.abs(lines.force_here) ** 2)))
