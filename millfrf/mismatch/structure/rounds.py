"""One round of the search in a structure: every cause is screened, and those that promise most are fitted."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference.diagnosis import Candidate, Remainder
from ..inference.process_pool import in_processes
from ..inference.search import Patience, Proposal, Round
from ..inference.settings import EvidenceSettings, Settings
from ..models.fitting import Fit
from ..models.hypothesis import Cause, Hypothesis
from ..physics.protocol import ChainPhysics, JointPhysics, ModePhysics, Physics, answer_name
from ..residual.structured_residual import leftover, share_of_response
from ..screening.joint_alternatives import twin_laws
from ..screening.joint_laws_fitted import SightedLaws, joint_candidates, laws_by_level, sighted_laws
from ..screening.linear_causes_fitted import SightedMode, channel_of, find_mode, gains_beside_laws, linear_candidates
from ..screening.score_tests import ScreenedChain, screen_chains
from ..screening.whitened_residual import noise_floor
from .acceptance import evidence_needed, impossible, possible_gains, strained

FEW = 3
"""Linear causes that promise little, at most, that are tried beside laws of any form."""


@dataclass(frozen=True)
class Standing:
    """Where the search stands when a round begins.

    Parameters
    ----------
    lines
        Windowed lines of the recordings.
    current, base
        Fits with the causes found so far, and with none.
    moving, before
        Parts of the residuals of ``current`` and of ``base`` that move with the signal.
    settings
        Thresholds of the diagnosis.
    modes_move
        Whether modes move with the level, which no linear cause makes them do.
    patience
        How long causes are looked for.
    """

    lines: list[WindowedSpectrum]
    current: Fit
    base: Fit
    moving: Remainder
    before: Remainder
    settings: Settings
    modes_move: bool = False
    patience: Patience = field(default_factory=Patience)

    def is_left(self, left: Remainder, hypothesis: Hypothesis) -> bool:
        """Whether more is left than noise and the form of a law make, or too much of the response for noise.

        What is left may swell with the signal no more than by chance where all of it comes from one resonance, so
        that a residual of much of the response is never taken for noise before joints were looked for. Where modes
        move with the level, something is left until a law is found, however steady the recordings are.
        """
        if self.modes_move and not hypothesis.laws:
            return True
        small, limits = self.settings.evidence.small, self.settings.verdict
        if left.share > limits.noise_like and left.size > 3 * small * self.before.size:
            return True
        return share_of_response(hypothesis, self.lines) > limits.most_of_response


@dataclass(frozen=True)
class StructureRound(Round[Fit]):
    """A round that says whether joint laws were tried along a direction and gained nothing."""

    laws_failed: bool = False


@dataclass(frozen=True)
class Weighed:
    """What a round fitted and weighed.

    Parameters
    ----------
    proposals
        Fitted causes with their evidence.
    candidates
        All causes, screened and fitted.
    sighted
        Whether joint laws were tried along a direction.
    """

    proposals: list[Proposal[Fit]]
    candidates: list[Candidate]
    sighted: bool

    def with_more(self, other: "Weighed") -> "Weighed":
        """This and what was weighed after it."""
        return Weighed(self.proposals + other.proposals, self.candidates + other.candidates, other.sighted)


def only_modes(proposals: Sequence[Proposal[Fit]]) -> bool:
    """Whether modes alone were found, or nothing: a few of them imitate a joint that hardens, drifts or rubs.

    Parameters
    ----------
    proposals
        Fitted causes that count.
    """
    return all(isinstance(one.fitted.hypothesis.causes[-1].physics, ModePhysics) for one in proposals)


def likeliest_seen(candidates: Iterable[Candidate], laws: Collection[str]) -> str:
    """Name of the joint law that was likeliest on the motion seen; empty where none was screened.

    Parameters
    ----------
    candidates
        Candidates of a round.
    laws
        Names of the joint laws that were weighed.
    """
    seen = [one for one in candidates if one.stage == "screened" and one.name in laws]
    return max(seen, key=lambda one: one.evidence).name if seen else ""


def weigh(standing: Standing, causes: Mapping[str, Physics]) -> Weighed:
    """Screen all causes, and fit those that promise most.

    Parameters
    ----------
    standing
        Where the search stands.
    causes
        Causes to weigh, by name.
    """
    lines, current, settings = standing.lines, standing.current, standing.settings
    laws = [physics for physics in causes.values() if isinstance(physics, JointPhysics)]
    much = standing.is_left(standing.moving, current.hypothesis)
    chains, mode, sighted = _screened(standing, causes, laws if much else [])
    weighed = [Candidate(answer_name(one.cause.physics), one.gain, "screened", channel_of(one.cause)) for one in chains]
    weighed += [Candidate(mode.physics.name, mode.gain, "screened")] if mode is not None else []
    weighed += sighted.weighed
    least = settings.search.within_reach * evidence_needed(current, standing.base, settings.evidence, own=True)
    stands_out = sighted.gain > 0
    chains, mode, sighted = _of_their_own(standing, chains, mode, sighted)
    proposals: list[Proposal[Fit]] = []
    linear = max([one.gain for one in chains] + [mode.gain if mode is not None else 0.0, 0.0])
    if sighted.gain > settings.search.laws_first * linear:
        proposals = joint_candidates(lines, current, sighted, settings, least)
    if not _explains(proposals, standing):
        tried = bool(proposals)
        proposals += _linear_candidates(standing, chains, mode, least)
        if not tried and _joints_are_due(proposals, standing):
            if not much:
                sighted = sighted_laws(lines, current, laws, settings)
                weighed += sighted.weighed
                stands_out = sighted.gain > 0
                sighted = _of_their_own(standing, [], None, sighted)[2]
            best = possible_gains(proposals, settings.evidence)
            gained = best[0].evidence if best else 0.0
            proposals += joint_candidates(lines, current, sighted, settings, least, gained)
    # to carry laws from level to level takes longest: for a law beside another, only while there is time
    in_time = not (current.hypothesis.laws and standing.patience.over)
    leads = much and in_time and _no_linear_cause_leads(proposals, settings.evidence)
    if laws and leads and not _explains(proposals, standing):
        proposals += laws_by_level(lines, current, laws, settings)
    proposals += twin_laws(lines, current, possible_gains(proposals, settings.evidence)[:1], causes)
    weighed += [fitted_candidate(one, settings.evidence) for one in proposals]
    return Weighed(proposals, weighed, stands_out)


def _screened(
    standing: Standing, causes: Mapping[str, Physics], laws: list[JointPhysics]
) -> tuple[list[ScreenedChain], SightedMode | None, SightedLaws]:
    """What every cause promises, without a fit: linear ones not found yet, a further mode, joint laws."""
    lines, current = standing.lines, standing.current
    own_noise, hypothesis = noise_floor(current, lines), current.hypothesis
    chains = [physics for physics in causes.values() if isinstance(physics, ChainPhysics)]
    modes = [physics for physics in causes.values() if isinstance(physics, ModePhysics)]
    makers: list[Callable[[], Any]] = [
        lambda: sighted_laws(lines, current, laws, standing.settings) if laws else SightedLaws((), ()),
        lambda: find_mode(own_noise, hypothesis, modes[0]) if modes else None,
        lambda: screen_chains(own_noise, hypothesis, chains),
    ]
    sighted, mode, screened = in_processes(makers)
    taken = {(cause.physics.name, cause.place) for cause in hypothesis.causes}
    return [one for one in screened if (one.cause.physics.name, one.cause.place) not in taken], mode, sighted


def _linear_candidates(
    standing: Standing, chains: list[ScreenedChain], mode: SightedMode | None, least: float
) -> list[Proposal[Fit]]:
    """Linear causes that promise most, fitted, and the next in line as long as none of them can be.

    A cause that stands for two has numbers that nothing real has: what is behind it may be one of the two.
    """
    lines, current, limits = standing.lines, standing.current, standing.settings.screening
    found = linear_candidates(lines, current, chains, mode, limits, least)
    for first in range(limits.most_linear, len(chains), limits.most_linear):
        if not found or possible_gains(found, standing.settings.evidence):
            break
        found += linear_candidates(lines, current, chains[first:], None, limits, least)
    return found


def _of_their_own(
    standing: Standing, chains: list[ScreenedChain], mode: SightedMode | None, sighted: SightedLaws
) -> tuple[list[ScreenedChain], SightedMode | None, SightedLaws]:
    """Causes that are fitted after a law: those that promise much, and of the others those that mend no law's form."""
    lines, current, settings = standing.lines, standing.current, standing.settings
    if not current.hypothesis.laws:
        return chains, mode, sighted
    needed = [evidence_needed(current, standing.base, settings.evidence, own=own) for own in (True, False)]
    small, much = (settings.search.within_reach * one for one in needed)
    if standing.moving.noise_like(settings.verdict.noise_like):
        # nothing is left that a small cause of its own would explain
        small = much
    chains = [one for one in chains if one.gain > small]
    chains = [one for one in chains if one.gain > much] + [one for one in chains if one.gain <= much][:FEW]
    mode = mode if mode is not None and mode.gain > small else None
    laws = [one for one in sighted.screened if one.gain > small]
    unsure = [one.cause for one in chains if one.gain <= much]
    unsure += [Cause(mode.physics, np.zeros(0))] if mode is not None and mode.gain <= much else []
    unsure += [one.causes[0] for one in laws if one.gain <= much]
    gains = gains_beside_laws(lines, current, unsure)
    out = {id(cause) for cause, gain in zip(unsure, gains, strict=True) if not gain.own(small, settings.evidence.own)}
    # a mode stands for all places, and its cause was made here
    lost = any(id(cause) in out for cause in unsure if isinstance(cause.physics, ModePhysics))
    kept = tuple(one for one in laws if id(one.causes[0]) not in out)
    return (
        [one for one in chains if id(one.cause) not in out],
        None if lost else mode,
        replace(sighted, screened=kept),
    )


def fitted_candidate(one: Proposal[Fit], evidence: EvidenceSettings) -> Candidate:
    """A fitted cause as it is told; one whose numbers cannot be says so.

    Parameters
    ----------
    one
        The fitted cause.
    evidence
        Thresholds of what is possible.
    """
    reason = impossible(one, evidence)
    place = {**one.location, "impossible": reason} if reason else one.location
    return Candidate(one.name, one.evidence, "impossible" if reason else "fitted", place)


def _explains(proposals: list[Proposal[Fit]], standing: Standing) -> bool:
    """Whether the best cause leaves too little that moves with the signal to look further."""
    best = possible_gains(proposals, standing.settings.evidence)
    if not best:
        return False
    hypothesis, limits = best[0].fitted.hypothesis, standing.settings.verdict
    if share_of_response(hypothesis, standing.lines) > limits.most_of_response:
        return False
    left = leftover(hypothesis, standing.lines)
    if left.share <= limits.noise_like:
        return True
    return left.size <= (1 - limits.explained) * standing.before.size and not strained(hypothesis)


def _no_linear_cause_leads(proposals: list[Proposal[Fit]], evidence: EvidenceSettings) -> bool:
    """Whether no linear cause is the best of a round: else it is taken first, and laws are tried beside it again.

    To carry laws from level to level takes longer than all other fits of a round.
    """
    best = possible_gains(proposals, evidence)
    return not best or not isinstance(best[0].fitted.hypothesis.causes[-1].physics, ChainPhysics)


def _joints_are_due(proposals: list[Proposal[Fit]], standing: Standing) -> bool:
    """Whether joint laws are tried beside linear causes: none was found, a mode may imitate them, or much is left."""
    best = possible_gains(proposals, standing.settings.evidence)
    if not best:
        current = standing.current.hypothesis
        return not current.has_added_physics or standing.is_left(standing.moving, current)
    hypothesis = best[0].fitted.hypothesis
    # modes are many-sided: a joint that drifts or rubs is imitated by a few of them
    if isinstance(hypothesis.causes[-1].physics, ModePhysics):
        return True
    return standing.is_left(leftover(hypothesis, standing.lines), hypothesis)
