"""Comparison of a modal model with recordings, as used by the search."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from estimation import WindowedSpectrum

from ..behaviour.behaviour_of_modes import Behaviour
from ..inference.diagnosis import Remainder
from ..inference.search import Proposal, Round, Search, equivalents_of
from ..inference.settings import Settings
from ..inference.work import WorkLimit
from ..models.cause import Cause
from ..models.fitting import Fit, Rival, converged_fit, fit, neglects_a_recording
from ..physics.protocol import JointPhysics, Physics, TwinPhysics, reported_name
from ..screening.joint_starts import laws_beyond, laws_in_place
from ..screening.linear_causes_fitted import gains_with_laws
from .acceptance import (
    Measured,
    corrects_clipping_repair,
    impossible,
    is_significant,
    plainest,
    plausible_proposals,
    required_evidence,
    twins_of,
)
from .rounds import (
    RoundCandidates,
    SearchState,
    StructureRound,
    candidate_after_fit,
    likeliest_on_motion,
    only_modes,
    screen_and_fit,
)
from .structured_residual import remainder_of

# most steps of a fit in which one cause is left out, and of the final fit with an accepted cause
PRUNING_STEPS, FINAL_STEPS = 20, 60


@dataclass(frozen=True)
class StructureComparison:
    """Recordings, causes and thresholds of one diagnosis of a structure."""

    lines: list[WindowedSpectrum]
    causes: Mapping[str, Physics]
    settings: Settings  # thresholds of the diagnosis
    before: Remainder  # structured residual when no cause is accepted
    # change of the modes with the level, without any law; None if it was not determined
    behaviour: Behaviour | None = None
    limit: WorkLimit = field(default_factory=WorkLimit)  # largest work of the search
    limits: Mapping[int, float] = field(default_factory=dict)

    @property
    def modes_move(self) -> bool:
        """Whether modes change with the level of excitation, which no linear cause explains."""
        return self.behaviour is not None and self.behaviour.follows_level

    @property
    def laws(self) -> set[str]:
        """Names under which joint laws are reported."""
        return {reported_name(cause) for cause in self.causes.values() if isinstance(cause, JointPhysics)}

    def finished(self, search: Search[Fit]) -> bool:
        """Return whether the search ends because its largest work is done and a cause is accepted.

        Before that the search goes on until a round finds no cause, as a large cause may hide a small one.
        """
        return bool(search.accepted) and self.limit.reached

    def round(self, search: Search[Fit]) -> Round[Fit]:
        """Screen and fit causes, and choose a significant one.

        Joint laws that failed in an earlier round are tried again if much of the structured residual has been explained
        since, or if only added modes are plausible, as these may imitate a law.
        """
        current = search.current
        moving = remainder_of(current.hypothesis, self.lines) if search.accepted else self.before
        standing = SearchState(
            self.lines, current, search.base, moving, self.before, self.settings, self.limit, self.modes_move
        )
        skip_laws = self._laws_failed_at(search) * self.settings.search.laws_again <= moving.size
        linear = {name: cause for name, cause in self.causes.items() if not isinstance(cause, JointPhysics)}
        candidates = screen_and_fit(standing, linear if skip_laws else self.causes)
        if skip_laws and only_modes(plausible_proposals(candidates.proposals, self.settings.evidence)):
            laws = {name: cause for name, cause in self.causes.items() if name not in linear}
            candidates = candidates.with_more(screen_and_fit(standing, laws))
        chosen, candidates = self._chosen(candidates, search)
        if chosen is not None:
            beyond = self._laws_beyond_limit(chosen, search)
            # the fit of the chosen law has converged meanwhile: this fit is compared with the rivals
            candidates = self._with_fitted(candidates, [chosen, *beyond]) if beyond else candidates
            chosen = max([chosen, *beyond], key=lambda proposal: proposal.evidence)
        equivalents = () if chosen is None else self._equivalents(candidates, chosen, current)
        failed = candidates.laws_tried and not any(
            proposal.fitted.hypothesis.causes[-1].axis is not None and proposal.evidence >= self.settings.evidence.least
            for proposal in candidates.proposals
        )
        return StructureRound(tuple(candidates.proposals), chosen, tuple(candidates.candidates), equivalents, failed)

    def without(self, search: Search[Fit], place: int) -> Fit:
        """Fit the last step of the search without one cause; the fit stops early if its result cannot be accepted."""
        last = search.current
        rival = Rival(last, self.needed(last, search.base))
        return fit(self.lines, last.hypothesis.without(place), last.noises, iterations=PRUNING_STEPS, rival=rival)

    def refitted_without(self, search: Search[Fit], place: int) -> Fit:
        """Fit the last step of the search without one cause, and never stop early."""
        last = search.current
        return fit(self.lines, last.hypothesis.without(place), last.noises, iterations=PRUNING_STEPS)

    def needed(self, current: Fit, base: Fit) -> float:
        """Return the evidence that a further cause needs if the causes of ``current`` are accepted."""
        return required_evidence(current, base, self.settings.evidence)

    def _chosen(self, candidates: RoundCandidates, search: Search[Fit]) -> tuple[Proposal[Fit] | None, RoundCandidates]:
        """Return the simplest form of the best significant cause, fitted to convergence, and all candidates.

        The candidates include other forms that were fitted meanwhile.
        """
        evidence = self.settings.evidence
        plausible, insignificant = plausible_proposals(candidates.proposals, evidence), list[Proposal[Fit]]()
        while (first := plainest(plausible, evidence.as_good)) is not None:
            best = twins_of(first, plausible, evidence.small)[0]
            converged = converged_fit(self.lines, best.fitted, search.base.score - best.fitted.score)
            chosen = replace(best, fitted=converged, evidence=search.current.score - converged.score)
            plausible = [proposal for proposal in plausible if proposal is not best]
            if impossible(chosen, evidence):
                continue
            if self._is_significant(chosen, search):
                return self._converged(chosen, search), candidates
            insignificant.append(chosen)
            # another form of the same cause may have significant numbers
            plausible = [proposal for proposal in plausible if proposal.name == best.name]
            if not plausible:
                forms = self._other_forms(chosen, candidates, search)
                candidates, plausible = self._with_fitted(candidates, forms), plausible_proposals(forms, evidence)
        return self._significant_otherwise(insignificant, search), candidates

    def _significant_otherwise(self, insignificant: list[Proposal[Fit]], search: Search[Fit]) -> Proposal[Fit] | None:
        """Return the best law whose numbers are significant when referred to the tip, or else whose force is.

        Numbers that end at a limit are not determined; the law beyond the limit, which has fewer, is tried before.
        """
        laws = [proposal for proposal in insignificant if proposal.name in self.laws]
        beyond = [other for proposal in laws for other in self._laws_beyond_limit(proposal, search)]
        significant = [proposal for proposal in beyond if self._is_significant(proposal, search)]
        if significant:
            return max(significant, key=lambda law: law.evidence)
        measures: tuple[Measured, ...] = ("tip", "force")
        for by in measures:
            significant = [proposal for proposal in laws if self._is_significant(proposal, search, by=by)]
            if significant:
                return self._converged(max(significant, key=lambda law: law.evidence), search)
        return None

    def _with_fitted(self, candidates: RoundCandidates, more: list[Proposal[Fit]]) -> RoundCandidates:
        """Return the candidates and further fitted proposals."""
        fitted = [candidate_after_fit(proposal, self.settings.evidence) for proposal in more]
        return candidates.with_more(RoundCandidates(more, fitted, candidates.laws_tried))

    def _converged(self, chosen: Proposal[Fit], search: Search[Fit]) -> Proposal[Fit]:
        """Fit an accepted cause until the fit converges.

        If the fit stopped before, its remaining gain would count for the next cause.
        """
        fitted = fit(self.lines, chosen.fitted.hypothesis, chosen.fitted.noises, iterations=FINAL_STEPS)
        farther = replace(chosen, fitted=fitted, evidence=search.current.score - fitted.score)
        better = farther.evidence > chosen.evidence and not impossible(farther, self.settings.evidence)
        return farther if better else chosen

    def _other_forms(
        self, chosen: Proposal[Fit], candidates: RoundCandidates, search: Search[Fit]
    ) -> list[Proposal[Fit]]:
        """Fit the forms of the chosen law that no round has fitted, or else those of its twin, at the same place."""
        known = {proposal.fitted.hypothesis.causes[-1].physics.name for proposal in candidates.proposals}
        laws = [cause for cause in self.causes.values() if isinstance(cause, JointPhysics)]
        own = [law for law in laws if reported_name(law) == chosen.name]
        twins = {self.causes[law.twin] for law in own if isinstance(law, TwinPhysics) and law.twin in self.causes}
        names = {reported_name(twin) for twin in twins}
        forms = [law for law in own if law.name not in known]
        forms = forms or [law for law in laws if reported_name(law) in names and law.name not in known]
        return laws_in_place(self.lines, search.current, chosen, forms, self.settings)

    def _laws_beyond_limit(self, chosen: Proposal[Fit], search: Search[Fit]) -> list[Proposal[Fit]]:
        """Fit the laws that lie beyond the limit at which the numbers of the chosen law end, at the same place."""
        laws = [cause for cause in self.causes.values() if isinstance(cause, JointPhysics)]
        proposals = laws_beyond(self.lines, search.current, chosen, laws, self.settings)
        converged = [self._converged(proposal, search) for proposal in proposals]
        return [proposal for proposal in converged if not impossible(proposal, self.settings.evidence)]

    def is_independent(self, search: Search[Fit], place: int, less: Fit) -> bool:
        """Return whether an accepted cause is independent of the form of the laws; ``less`` is the fit without it."""
        # the cause of the current fit is used, as modes that were added later also participate in its joint
        cause = search.current.hypothesis.causes[place]
        return self._is_independent_of_form(cause, (less, search.current), search.base)

    def _is_significant(self, chosen: Proposal[Fit], search: Search[Fit], *, by: Measured = "numbers") -> bool:
        """Return whether a cause has sufficient evidence.

        After a law was accepted, a cause that is independent of its form needs less evidence.
        """
        current, base, evidence = search.current, search.base, self.settings.evidence
        if corrects_clipping_repair(chosen, self.limits, self.lines, evidence):
            return False
        test = partial(is_significant, chosen, current, base, self.lines, evidence, by=by)
        if test():
            return True
        if not current.hypothesis.laws or not test(own=True):
            return False
        return self._is_independent_of_form(chosen.fitted.hypothesis.causes[-1], (current, chosen.fitted), base)

    def _is_independent_of_form(self, cause: Cause, fits: tuple[Fit, Fit], base: Fit) -> bool:
        """Return whether a cause is a separate effect and does not only correct the form of the laws.

        The first fit is without the cause, the second fit with it. The cause must gain even if the laws have a free
        form, and it must explain most of the structured residual of the first fit. If the residual of the first fit is
        noise, a small cause may only correct the form of the laws.
        """
        (less, complete), evidence, limits = fits, self.settings.evidence, self.settings.verdict
        needed = required_evidence(less, base, evidence, own=True)
        if not less.hypothesis.laws or less.score - complete.score < needed:
            return False
        before, after = (remainder_of(fit_.hypothesis, self.lines) for fit_ in fits)
        if before.noise_like(limits.noise_like):
            return False
        if not (after.noise_like(limits.noise_like) or after.size <= (1 - limits.partly) * before.size):
            return False
        return gains_with_laws(self.lines, less, [cause])[0].is_independent(needed, evidence.own)

    def _equivalents(self, candidates: RoundCandidates, chosen: Proposal[Fit], current: Fit) -> tuple[str, ...]:
        """Return the names of causes that the data cannot distinguish from the chosen one.

        If the effect is so strong that the fit neglects a recording, the fit of a law may not have converged. The law
        with the largest screened gain is then also equivalent if its evidence is at least half of the chosen law's.
        """
        evidence, limits = self.settings.evidence, self.settings.verdict
        possible = [proposal for proposal in candidates.proposals if not impossible(proposal, evidence)]
        if _was_moved_from_tip(chosen):
            possible, chosen = _at_one_place(possible, chosen)
        near = equivalents_of(possible, chosen, evidence.as_good)
        if chosen.name not in self.laws:
            return near
        laws = [proposal for proposal in possible if proposal.name in self.laws]
        near_in_form = equivalents_of(laws, chosen, (1 - evidence.as_good_form) * chosen.evidence)
        strong_rival: tuple[str, ...] = ()
        if neglects_a_recording(self.lines, current.hypothesis, limits.most_of_response):
            half = equivalents_of(laws, chosen, (1 - limits.partly) * chosen.evidence)
            strong_rival = tuple(name for name in half if name == likeliest_on_motion(candidates.candidates, self.laws))
        return tuple(dict.fromkeys([*near, *near_in_form, *strong_rival]))

    def _laws_failed_at(self, search: Search[Fit]) -> float:
        """Return the size of the structured residual when joint laws last failed; infinite if they have not failed."""
        if search.current.hypothesis.laws:
            return float("inf")
        failed = [
            step
            for step, round_ in zip(search.steps, search.rounds, strict=False)
            if isinstance(round_, StructureRound) and round_.laws_failed
        ]
        if not failed:
            return float("inf")
        return remainder_of(failed[-1].hypothesis, self.lines).size


def _was_moved_from_tip(proposal: Proposal[Fit]) -> bool:
    """Return whether a law was found at the tip and then fitted away from it."""
    return "participation" in proposal.location and "direction" in proposal.location


def _at_one_place(possible: list[Proposal[Fit]], chosen: Proposal[Fit]) -> tuple[list[Proposal[Fit]], Proposal[Fit]]:
    """Return the rivals of a law that was moved away from the tip, and this law, all with comparable evidence.

    The evidence that the law gained by the move is subtracted from the law and from each rival that was also moved.
    Rivals that were not moved keep their evidence at the tip.
    """
    at_tip = [
        proposal.evidence
        for proposal in possible
        if proposal.name == chosen.name and "participation" not in proposal.location
    ]
    if not at_tip:
        return possible, chosen
    lead = chosen.evidence - max(at_tip)
    moved = [
        replace(proposal, evidence=proposal.evidence - lead) for proposal in possible if _was_moved_from_tip(proposal)
    ]
    names = {proposal.name for proposal in moved}
    return [*moved, *(proposal for proposal in possible if proposal.name not in names)], replace(
        chosen, evidence=max(at_tip)
    )
