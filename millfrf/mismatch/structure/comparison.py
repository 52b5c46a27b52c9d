"""The comparison of a modal model with recordings, as the search sees it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

from estimation import WindowedSpectrum

from ..behaviour.behaviour_of_modes import Behaviour
from ..inference.diagnosis import Remainder
from ..inference.search import Patience, Proposal, Round, Search, equivalents_of
from ..inference.settings import Settings
from ..models.fitting import Fit, Rival, fit
from ..models.hypothesis import Cause
from ..models.refinement import gives_one_up, settled
from ..physics.protocol import JointPhysics, Physics, TwinPhysics, answer_name
from ..residual.structured_residual import leftover
from ..screening.joint_alternatives import laws_beyond, laws_in_place
from ..screening.linear_causes_fitted import gains_beside_laws
from .acceptance import evidence_needed, impossible, mends_a_limit, plainest, possible_gains, twins_of, worth_it
from .rounds import Standing, StructureRound, Weighed, fitted_candidate, likeliest_seen, only_modes, weigh

PRUNING, TO_REST = 20, 60
"""Steps at most of a fit without one of its causes, and of one with a cause that is taken."""


@dataclass(frozen=True)
class StructureComparison:
    """Recordings, causes and thresholds of one diagnosis of a structure.

    Parameters
    ----------
    lines
        Windowed lines of the mended recordings.
    causes
        Causes that are weighed, by name.
    settings
        Thresholds of the diagnosis.
    before
        Part of the residual that moves with the signal when no cause is accepted.
    behaviour
        What modes do with the level, without any law; None: not looked at.
    patience
        How long causes are looked for.
    limits
        Evidence of each limit at which a channel clips, by the number of the response.
    """

    lines: list[WindowedSpectrum]
    causes: Mapping[str, Physics]
    settings: Settings
    before: Remainder
    behaviour: Behaviour | None = None
    patience: Patience = field(default_factory=Patience)
    limits: Mapping[int, float] = field(default_factory=dict)

    @property
    def modes_move(self) -> bool:
        """Whether modes move with the level, which no linear cause makes them do."""
        return self.behaviour is not None and self.behaviour.follows_level

    @property
    def laws(self) -> set[str]:
        """Names under which joint laws are told."""
        return {answer_name(one) for one in self.causes.values() if isinstance(one, JointPhysics)}

    def finished(self, search: Search[Fit]) -> bool:
        """Whether to stop before a round finds nothing: a small cause may hide behind a large one, so only in time."""
        return bool(search.accepted) and self.patience.over

    def round(self, search: Search[Fit]) -> Round[Fit]:
        """Screen and fit causes; where joint laws failed before, they are tried again if much has gone since.

        They are also tried again where nothing else explains more than a further mode, which may imitate them.
        """
        current = search.current
        moving = leftover(current.hypothesis, self.lines) if search.accepted else self.before
        standing = Standing(
            self.lines, current, search.base, moving, self.before, self.settings, self.modes_move, self.patience
        )
        spared = self._laws_failed_at(search) * self.settings.search.laws_again <= moving.size
        linear = {name: one for name, one in self.causes.items() if not isinstance(one, JointPhysics)}
        weighed = weigh(standing, linear if spared else self.causes)
        if spared and only_modes(possible_gains(weighed.proposals, self.settings.evidence)):
            laws = {name: one for name, one in self.causes.items() if name not in linear}
            weighed = weighed.with_more(weigh(standing, laws))
        chosen, weighed = self._chosen(weighed, search)
        if chosen is not None:
            beyond = self._beyond_its_name(chosen, search)
            # the chosen law has come to rest since it was weighed: its rivals are compared with it there
            weighed = self._with_fitted(weighed, [chosen, *beyond]) if beyond else weighed
            chosen = max([chosen, *beyond], key=lambda one: one.evidence)
        equivalents = () if chosen is None else self._equivalents(weighed, chosen, current)
        failed = weighed.sighted and not any(
            one.fitted.hypothesis.causes[-1].axis is not None and one.evidence >= self.settings.evidence.least
            for one in weighed.proposals
        )
        return StructureRound(tuple(weighed.proposals), chosen, tuple(weighed.candidates), equivalents, failed)

    def without(self, search: Search[Fit], place: int) -> Fit:
        """The last step fitted without one of its causes; not to its end where it is too much worse to be taken."""
        last = search.current
        rival = Rival(last, self.needed(last, search.base))
        return fit(self.lines, last.hypothesis.without(place), last.noises, iterations=PRUNING, rival=rival)

    def refitted_without(self, search: Search[Fit], place: int) -> Fit:
        """The last step without one of its causes, fitted to its end."""
        last = search.current
        return fit(self.lines, last.hypothesis.without(place), last.noises, iterations=PRUNING)

    def needed(self, current: Fit, base: Fit) -> float:
        """Evidence that a further cause needs beside those of ``current``."""
        return evidence_needed(current, base, self.settings.evidence)

    def _chosen(self, weighed: Weighed, search: Search[Fit]) -> tuple[Proposal[Fit] | None, Weighed]:
        """The plainest form of the best cause, fitted until it rests and still possible there, if it is worth it.

        With what was weighed, other forms of it that were fitted meanwhile among it.
        """
        evidence = self.settings.evidence
        good, unclear = possible_gains(weighed.proposals, evidence), list[Proposal[Fit]]()
        while (first := plainest(good, evidence.as_good)) is not None:
            best = twins_of(first, good, evidence.small)[0]
            rested = settled(self.lines, best.fitted, search.base.score - best.fitted.score)
            chosen = replace(best, fitted=rested, evidence=search.current.score - rested.score)
            good = [one for one in good if one is not best]
            if impossible(chosen, evidence):
                continue
            if self._is_worth_it(chosen, search):
                return self._at_rest(chosen, search), weighed
            unclear.append(chosen)
            # another form of the same cause may have numbers that the data do tell
            good = [one for one in good if one.name == best.name]
            if not good:
                forms = self._other_forms(chosen, weighed, search)
                weighed, good = self._with_fitted(weighed, forms), possible_gains(forms, evidence)
        return self._clear_at_tip(unclear, search), weighed

    def _clear_at_tip(self, unclear: list[Proposal[Fit]], search: Search[Fit]) -> Proposal[Fit] | None:
        """The best law of a joint inside whose numbers stand out once they are counted in the tip's motion."""
        laws = [one for one in unclear if one.name in self.laws and self._is_worth_it(one, search, at_tip=True)]
        return self._at_rest(max(laws, key=lambda one: one.evidence), search) if laws else None

    def _with_fitted(self, weighed: Weighed, more: list[Proposal[Fit]]) -> Weighed:
        """What was weighed, and more that was fitted after it."""
        told = [fitted_candidate(one, self.settings.evidence) for one in more]
        return weighed.with_more(Weighed(more, told, weighed.sighted))

    def _at_rest(self, chosen: Proposal[Fit], search: Search[Fit]) -> Proposal[Fit]:
        """A cause that is taken, fitted to its end: a next one must not live on what this one left undone."""
        fitted = fit(self.lines, chosen.fitted.hypothesis, chosen.fitted.noises, iterations=TO_REST)
        farther = replace(chosen, fitted=fitted, evidence=search.current.score - fitted.score)
        better = farther.evidence > chosen.evidence and not impossible(farther, self.settings.evidence)
        return farther if better else chosen

    def _other_forms(self, chosen: Proposal[Fit], weighed: Weighed, search: Search[Fit]) -> list[Proposal[Fit]]:
        """Forms of a law that no round has fitted yet, in its place; then those of the law that is its twin."""
        known = {one.fitted.hypothesis.causes[-1].physics.name for one in weighed.proposals}
        laws = [one for one in self.causes.values() if isinstance(one, JointPhysics)]
        own = [one for one in laws if answer_name(one) == chosen.name]
        twins = {self.causes[one.twin] for one in own if isinstance(one, TwinPhysics) and one.twin in self.causes}
        names = {answer_name(one) for one in twins}
        forms = [one for one in own if one.name not in known]
        forms = forms or [one for one in laws if answer_name(one) in names and one.name not in known]
        return laws_in_place(self.lines, search.current, chosen, forms, self.settings)

    def _beyond_its_name(self, chosen: Proposal[Fit], search: Search[Fit]) -> list[Proposal[Fit]]:
        """The laws beyond the limit at which the chosen law's numbers end, fitted to their ends at its place."""
        laws = [one for one in self.causes.values() if isinstance(one, JointPhysics)]
        tried = laws_beyond(self.lines, search.current, chosen, laws, self.settings)
        rested = [self._at_rest(one, search) for one in tried]
        return [one for one in rested if not impossible(one, self.settings.evidence)]

    def is_of_its_own(self, search: Search[Fit], place: int, less: Fit) -> bool:
        """Whether an accepted cause mends no law's form, and explains most of what moves with the signal without it."""
        # as it is now: modes that were found later take part in its joint, too
        cause = search.current.hypothesis.causes[place]
        return self._mends_no_form(cause, (less, search.current), search.base)

    def _is_worth_it(self, chosen: Proposal[Fit], search: Search[Fit], *, at_tip: bool = False) -> bool:
        """Whether a cause has enough evidence; after a law less is enough of one that mends no form."""
        current, base, evidence = search.current, search.base, self.settings.evidence
        if mends_a_limit(chosen, self.limits, self.lines, evidence):
            return False
        worth = partial(worth_it, chosen, current, base, self.lines, evidence, at_tip=at_tip)
        if worth():
            return True
        if not current.hypothesis.laws or not worth(own=True):
            return False
        return self._mends_no_form(chosen.fitted.hypothesis.causes[-1], (current, chosen.fitted), base)

    def _mends_no_form(self, cause: Cause, fits: tuple[Fit, Fit], base: Fit) -> bool:
        """Whether a cause (second fit) stands beside laws of any form, and explains most of what the first fit leaves.

        What moves with the signal tells an effect that is there from one that an odd form asks for here and there.
        Where the law leaves nothing that does, a small cause may mend anything.
        """
        (less, whole), evidence, limits = fits, self.settings.evidence, self.settings.verdict
        needed = evidence_needed(less, base, evidence, own=True)
        if not less.hypothesis.laws or less.score - whole.score < needed:
            return False
        before, after = (leftover(one.hypothesis, self.lines) for one in fits)
        if before.noise_like(limits.noise_like):
            return False
        if not (after.noise_like(limits.noise_like) or after.size <= (1 - limits.partly) * before.size):
            return False
        return gains_beside_laws(self.lines, less, [cause])[0].own(needed, evidence.own)

    def _equivalents(self, weighed: Weighed, chosen: Proposal[Fit], current: Fit) -> tuple[str, ...]:
        """Names that cannot be told from the chosen one.

        Of an effect so strong that a recording was given up, the law that was likeliest on the motion seen is one of
        them, too, if it was simulated and brings half of the evidence: fits of neither are sure to have ended.
        """
        evidence, limits = self.settings.evidence, self.settings.verdict
        possible = [one for one in weighed.proposals if not impossible(one, evidence)]
        if _moved_inside(chosen):
            possible, chosen = _at_one_place(possible, chosen)
        near = equivalents_of(possible, chosen, evidence.as_good)
        if chosen.name not in self.laws:
            return near
        laws = [one for one in possible if one.name in self.laws]
        as_forms_go = equivalents_of(laws, chosen, (1 - evidence.as_good_form) * chosen.evidence)
        sighted: tuple[str, ...] = ()
        if gives_one_up(self.lines, current.hypothesis, limits.most_of_response):
            half = equivalents_of(laws, chosen, (1 - limits.partly) * chosen.evidence)
            sighted = tuple(name for name in half if name == likeliest_seen(weighed.candidates, self.laws))
        return tuple(dict.fromkeys([*near, *as_forms_go, *sighted]))

    def _laws_failed_at(self, search: Search[Fit]) -> float:
        """Power that moved with the signal when joint laws last failed; infinite where they did not."""
        if search.current.hypothesis.laws:
            return float("inf")
        failed = [
            step
            for step, one in zip(search.steps, search.rounds, strict=False)
            if isinstance(one, StructureRound) and one.laws_failed
        ]
        if not failed:
            return float("inf")
        return leftover(failed[-1].hypothesis, self.lines).size


def _moved_inside(one: Proposal[Fit]) -> bool:
    """Whether a law was found at the tip, and tried inside then."""
    return "participation" in one.location and "direction" in one.location


def _at_one_place(possible: list[Proposal[Fit]], chosen: Proposal[Fit]) -> tuple[list[Proposal[Fit]], Proposal[Fit]]:
    """Rivals of a law that was moved inside, and that law, with evidence that compares: of one place.

    The rivals that were tried inside, too, are compared there, and all others at the tip, where that law once stood.
    """
    there = [one.evidence for one in possible if one.name == chosen.name and "participation" not in one.location]
    if not there:
        return possible, chosen
    lead = chosen.evidence - max(there)
    inside = [replace(one, evidence=one.evidence - lead) for one in possible if _moved_inside(one)]
    names = {one.name for one in inside}
    return [*inside, *(one for one in possible if one.name not in names)], replace(chosen, evidence=max(there))
