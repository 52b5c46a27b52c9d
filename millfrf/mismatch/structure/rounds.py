"""One round of the search: every cause is screened, and the promising ones are fitted."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from estimation import WindowedSpectrum

from ..inference.diagnosis import IMPOSSIBLE, SCREENED, Candidate, Remainder
from ..inference.search import Proposal, Round, in_processes
from ..inference.settings import EvidenceSettings, Settings
from ..inference.work import WorkLimit
from ..models.cause import Cause
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..physics.linear_causes import MissingMode
from ..physics.protocol import ChainPhysics, JointPhysics, Physics, reported_name
from ..screening.joint_laws_fitted import ScreenedLaws, joint_candidates, laws_by_level, screened_laws
from ..screening.joint_starts import twin_laws
from ..screening.linear_causes_fitted import (
    ScreenedMode,
    channel_of,
    find_mode,
    gains_with_laws,
    linear_candidates,
    transducers_of,
)
from ..screening.preloads import laws_with_preloads
from ..screening.score_tests import ScreenedChain, screen_chains
from ..screening.short_recordings import laws_of_short_recordings
from ..screening.whitened_residual import noise_floor
from .acceptance import has_law_beyond_limits, impossible, plausible_proposals, required_evidence
from .structured_residual import remainder_of, share_of_response

MAX_UNCERTAIN = 3  # most linear causes with a small screened gain that are tested together with laws of free form


@dataclass(frozen=True)
class SearchState:
    """State of the search at the beginning of a round."""

    lines: list[WindowedSpectrum]
    # fit with the accepted causes, and fit without causes
    current: Fit
    base: Fit
    # structured residuals of ``current`` and of ``base``
    moving: Remainder
    before: Remainder
    settings: Settings  # thresholds of the diagnosis
    limit: WorkLimit  # largest work of the search
    modes_move: bool = False  # whether modes change with the level of excitation, which no linear cause explains

    def has_structured_residual(self, remainder: Remainder, hypothesis: Hypothesis) -> bool:
        """Return whether the residual contains more than noise and the form error of a law.

        A large share of the response is always taken as structured, because the power of a residual from one resonance
        may follow the signal only by chance. If modes change with the level, the residual counts as structured until a
        law is accepted.
        """
        if self.modes_move and not hypothesis.laws:
            return True
        small, limits = self.settings.evidence.small, self.settings.verdict
        if remainder.share > limits.noise_like and remainder.size > 3 * small * self.before.size:
            return True
        return share_of_response(hypothesis, self.lines) > limits.most_of_response

    def law_is_significant(self, screened: ScreenedLaws) -> bool:
        """Return whether the score test of a first law shows that the residual is no noise.

        Whether the residual follows the signal is not seen in a short recording, or under a steady excitation.
        """
        return not self.current.hypothesis.laws and screened.gain > self.settings.evidence.large


@dataclass(frozen=True)
class StructureRound(Round[Fit]):
    """Round of the search that also records whether joint laws were tried without success."""

    laws_failed: bool = False


@dataclass(frozen=True)
class RoundCandidates:
    """Fitted proposals and all candidates of a round."""

    proposals: list[Proposal[Fit]]  # fitted causes with their evidence
    candidates: list[Candidate]  # all causes, screened and fitted
    laws_tried: bool  # whether joint laws were tried along a direction

    def with_more(self, other: "RoundCandidates") -> "RoundCandidates":
        """Return these proposals and candidates together with those of ``other``, which were fitted later."""
        return RoundCandidates(self.proposals + other.proposals, self.candidates + other.candidates, other.laws_tried)


def only_modes(proposals: Sequence[Proposal[Fit]]) -> bool:
    """Return whether all proposals are added modes; also true without proposals.

    A few added modes can imitate a joint that hardens, drifts or has friction.
    """
    return all(isinstance(proposal.fitted.hypothesis.causes[-1].physics, MissingMode) for proposal in proposals)


def likeliest_on_motion(candidates: Iterable[Candidate], laws: Collection[str]) -> str:
    """Return the name of the law with the largest screened gain; empty if none was screened."""
    seen = [candidate for candidate in candidates if candidate.stage == SCREENED and candidate.name in laws]
    return max(seen, key=lambda state: state.evidence).name if seen else ""


def screen_and_fit(state: SearchState, causes: Mapping[str, Physics]) -> RoundCandidates:
    """Screen all causes by name, and fit those with a large screened gain."""
    lines, current, settings = state.lines, state.current, state.settings
    laws = [physics for physics in causes.values() if isinstance(physics, JointPhysics)]
    chains, mode, tested = _screened(state, causes, laws)
    structured = state.has_structured_residual(state.moving, current.hypothesis) or state.law_is_significant(tested)
    screened = tested if structured else ScreenedLaws((), ())
    candidates = [
        Candidate(reported_name(chain.cause.physics), chain.gain, SCREENED, channel_of(chain.cause)) for chain in chains
    ]
    candidates += [Candidate(mode.physics.name, mode.gain, SCREENED)] if mode is not None else []
    candidates += screened.candidates
    least = settings.search.within_reach * required_evidence(current, state.base, settings.evidence, own=True)
    laws_promise = screened.gain > 0
    chains, mode, screened = _independent_candidates(state, chains, mode, screened)
    proposals: list[Proposal[Fit]] = []
    linear = max([chain.gain for chain in chains] + [mode.gain if mode is not None else 0.0, 0.0])
    if screened.gain > settings.search.laws_first * linear:
        proposals = joint_candidates(lines, current, screened, settings, least)
    if not _explains(proposals, state):
        laws_fitted = bool(proposals)
        proposals += _linear_candidates(state, chains, mode, least, causes.values())
        if not laws_fitted and _laws_are_needed(proposals, state):
            if not structured:
                screened = tested
                candidates += screened.candidates
                laws_promise = screened.gain > 0
                screened = _independent_candidates(state, [], None, screened)[2]
            best = plausible_proposals(proposals, settings.evidence)
            best_gain = best[0].evidence if best else 0.0
            proposals += joint_candidates(lines, current, screened, settings, least, best_gain)
    # fitting level by level takes longest: a second law is tried this way only before the limit of the work
    affordable = not (current.hypothesis.laws and state.limit.reached)
    leads = structured and affordable and _no_linear_cause_is_best(proposals, settings.evidence)
    if laws and leads and not _explains(proposals, state):
        proposals += laws_by_level(lines, current, laws, settings)
    if laws and structured:
        simulated, ranked = laws_of_short_recordings(lines, current, laws, settings)
        # a simulation shows the form of a law in a short recording, the estimated motion hardly does
        names = {reported_name(law) for law in laws} if ranked else set()
        proposals += simulated
        candidates = [candidate for candidate in candidates if candidate.name not in names] + ranked
    proposals += laws_with_preloads(lines, current, proposals, settings)
    proposals += twin_laws(lines, current, plausible_proposals(proposals, settings.evidence)[:1], causes)
    candidates += [candidate_after_fit(proposal, settings.evidence) for proposal in proposals]
    return RoundCandidates(proposals, candidates, laws_promise)


def _screened(
    state: SearchState, causes: Mapping[str, Physics], laws: list[JointPhysics]
) -> tuple[list[ScreenedChain], ScreenedMode | None, ScreenedLaws]:
    """Return the screened gains of linear causes that were not accepted yet, of a further mode, and of joint laws."""
    lines, current = state.lines, state.current
    own_noise, hypothesis = noise_floor(current, lines), current.hypothesis
    chains = [physics for physics in causes.values() if isinstance(physics, ChainPhysics)]
    modes = [physics for physics in causes.values() if isinstance(physics, MissingMode)]
    makers: list[Callable[[], Any]] = [
        lambda: screened_laws(lines, current, laws, state.settings) if laws else ScreenedLaws((), ()),
        lambda: find_mode(own_noise, hypothesis, modes[0]) if modes else None,
        lambda: screen_chains(own_noise, hypothesis, chains),
    ]
    screened_joints, mode, screened = in_processes(makers)
    taken = {(cause.physics.name, cause.place) for cause in hypothesis.causes}
    return (
        [candidate for candidate in screened if (candidate.cause.physics.name, candidate.cause.place) not in taken],
        mode,
        screened_joints,
    )


def _linear_candidates(
    state: SearchState,
    chains: list[ScreenedChain],
    mode: ScreenedMode | None,
    least: float,
    causes: Iterable[Physics],
) -> list[Proposal[Fit]]:
    """Fit the most promising linear causes; continue with the next ones until a cause is plausible.

    A cause that imitates two true causes at once has impossible numbers. The next causes may be one of these two.
    """
    lines, current, limits = state.lines, state.current, state.settings.screening
    proposals = linear_candidates(lines, current, chains, mode, limits, least)
    for added in [each for each in proposals if only_modes([each]) and each.evidence > least]:
        proposals += transducers_of(lines, current, added, causes)
    for first in range(limits.most_linear, len(chains), limits.most_linear):
        if not proposals or plausible_proposals(proposals, state.settings.evidence):
            break
        proposals += linear_candidates(lines, current, chains[first:], None, limits, least)
    return proposals


def _independent_candidates(
    state: SearchState, chains: list[ScreenedChain], mode: ScreenedMode | None, screened: ScreenedLaws
) -> tuple[list[ScreenedChain], ScreenedMode | None, ScreenedLaws]:
    """Select the candidates that are fitted after a law was accepted.

    All candidates with a large screened gain are selected. Candidates with a small gain are selected only if they do
    not just correct the form of the law.
    """
    lines, current, settings = state.lines, state.current, state.settings
    if not current.hypothesis.laws:
        return chains, mode, screened
    needed = [required_evidence(current, state.base, settings.evidence, own=own) for own in (True, False)]
    small, much = (settings.search.within_reach * need for need in needed)
    if state.moving.noise_like(settings.verdict.noise_like):
        # the residual is noise: a small independent cause would explain nothing
        small = much
    chains = [chain for chain in chains if chain.gain > small]
    chains = [chain for chain in chains if chain.gain > much] + [chain for chain in chains if chain.gain <= much][
        :MAX_UNCERTAIN
    ]
    mode = mode if mode is not None and mode.gain > small else None
    laws = [candidate for candidate in screened.screened if candidate.gain > small]
    uncertain = [chain.cause for chain in chains if chain.gain <= much]
    uncertain += [Cause(mode.physics, np.zeros(0))] if mode is not None and mode.gain <= much else []
    uncertain += [law.causes[0] for law in laws if law.gain <= much]
    gains = gains_with_laws(lines, current, uncertain)
    dependent = {
        id(cause)
        for cause, gain in zip(uncertain, gains, strict=True)
        if not gain.is_independent(small, settings.evidence.own)
    }
    # a screened mode contains no cause: the cause without values made above represents it
    mode_dependent = any(id(cause) in dependent for cause in uncertain if isinstance(cause.physics, MissingMode))
    remaining = tuple(law for law in laws if id(law.causes[0]) not in dependent)
    return (
        [chain for chain in chains if id(chain.cause) not in dependent],
        None if mode_dependent else mode,
        replace(screened, screened=remaining),
    )


def candidate_after_fit(proposal: Proposal[Fit], evidence: EvidenceSettings) -> Candidate:
    """Return the candidate of a fitted cause, with the reason if its numbers are impossible."""
    reason = impossible(proposal, evidence)
    place = {**proposal.location, "impossible": reason} if reason else proposal.location
    return Candidate(proposal.name, proposal.evidence, IMPOSSIBLE if reason else "fitted", place)


def _explains(proposals: list[Proposal[Fit]], state: SearchState) -> bool:
    """Return whether the structured residual of the best proposal is too small for further fits in this round."""
    best = plausible_proposals(proposals, state.settings.evidence)
    if not best:
        return False
    hypothesis, limits = best[0].fitted.hypothesis, state.settings.verdict
    if share_of_response(hypothesis, state.lines) > limits.most_of_response:
        return False
    remainder = remainder_of(hypothesis, state.lines)
    if remainder.share <= limits.noise_like:
        return True
    return remainder.size <= (1 - limits.explained) * state.before.size and not has_law_beyond_limits(hypothesis)


def _no_linear_cause_is_best(proposals: list[Proposal[Fit]], evidence: EvidenceSettings) -> bool:
    """Return whether the best proposal of a round is not a linear cause.

    A linear cause is accepted first, and laws are tried again with it. Fitting laws level by level takes longer than
    all other fits of a round.
    """
    best = plausible_proposals(proposals, evidence)
    return not best or not isinstance(best[0].fitted.hypothesis.causes[-1].physics, ChainPhysics)


def _laws_are_needed(proposals: list[Proposal[Fit]], state: SearchState) -> bool:
    """Return whether joint laws are tried after the linear causes.

    They are tried if the best plausible cause is an added mode or leaves a structured residual. Without a plausible
    cause they are tried if no physics was added yet or if a structured residual remains.
    """
    best = plausible_proposals(proposals, state.settings.evidence)
    if not best:
        current = state.current.hypothesis
        return not current.has_added_physics or state.has_structured_residual(state.moving, current)
    hypothesis = best[0].fitted.hypothesis
    # a few modes imitate a joint that drifts or has friction
    if isinstance(hypothesis.causes[-1].physics, MissingMode):
        return True
    return state.has_structured_residual(remainder_of(hypothesis, state.lines), hypothesis)
