"""The ranking of proposals and the state of a search, against brute force over random rounds."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.mismatch import Candidate
from millfrf.mismatch.inference.search import Proposal, Round, Search, best_first, equivalents_of, without_cause
from millfrf.mismatch.inference.settings import EvidenceSettings


@dataclass(frozen=True)
class Scored:
    """A fit that is nothing but its score."""

    score: float


def proposal(name: str, evidence: float) -> Proposal[Scored]:
    return Proposal(name, {}, Scored(-evidence), evidence)


NAMES = st.sampled_from(["play", "friction", "delay", "gain", "hardening"])
EVIDENCE = st.integers(-40, 40).map(float)
"""Whole numbers: some are equal, and differences are exact."""

PROPOSALS = st.lists(st.builds(proposal, NAMES, EVIDENCE), min_size=1, max_size=9)


@given(PROPOSALS)
def test_the_best_comes_first_and_equals_keep_their_order(proposals: list[Proposal[Scored]]) -> None:
    """By hand: take the first of those with most evidence, until none is left."""
    left, expected = list(proposals), []
    while left:
        most = max(each.evidence for each in left)
        best = next(k for k, each in enumerate(left) if each.evidence == most)
        expected.append(left.pop(best))
    ranked = best_first(proposals)
    assert len(ranked) == len(expected)
    assert all(each is other for each, other in zip(ranked, expected, strict=True))


@given(PROPOSALS, st.data(), st.sampled_from([0.0, 1.0, 6.0, 10.0, 1000.0]))
def test_equivalents_are_all_other_names_within_reach(
    proposals: list[Proposal[Scored]], data: st.DataObject, as_good: float
) -> None:
    chosen = data.draw(st.sampled_from(proposals))
    result = equivalents_of(proposals, chosen, as_good)
    expected = {
        name
        for name in {each.name for each in proposals} - {chosen.name}
        if chosen.evidence - max(each.evidence for each in proposals if each.name == name) < as_good
    }
    assert set(result) == expected
    assert len(result) == len(expected)
    places = [next(k for k, each in enumerate(proposals) if each.name == name and
                   each.evidence > chosen.evidence - as_good) for name in result]  # fmt: skip
    assert places == sorted(places)


def test_evidence_that_just_reaches_is_not_as_good() -> None:
    chosen = proposal("play", 30.0)
    others = [proposal("friction", 20.0), proposal("delay", 20.0 + 1e-9), proposal("play", 29.0)]
    assert equivalents_of([chosen, *others], chosen, 10.0) == ("delay",)
    assert equivalents_of([chosen], chosen, 10.0) == ()


def test_equivalents_are_within_the_likelihood_ratio_that_the_settings_state() -> None:
    """Two lines through the same noise: ``evidence`` differs by ``2 ln (L1 / L2)``, as both have one number."""
    as_good = EvidenceSettings().as_good
    x = np.linspace(-1, 1, 200)
    truth = x / np.linalg.norm(x)
    beside = np.ones(200) / np.sqrt(200)  # at a right angle to the truth
    for ratio, stated in ((0.98 * np.exp(as_good / 2), True), (1.02 * np.exp(as_good / 2), False)):
        y = 30 * truth
        # a column that is turned from the truth explains 30^2 cos^2: 2 ln ratio less
        cosine = np.sqrt(1 - 2 * np.log(ratio) / 30**2)
        columns = {"truth": truth, "turned": cosine * truth + np.sqrt(1 - cosine**2) * beside}
        fits = {name: float(y @ y - (column @ y) ** 2) for name, column in columns.items()}
        proposals = [Proposal(name, {}, Scored(rest), float(y @ y) - rest) for name, rest in fits.items()]
        likelihoods = {name: np.exp(-0.5 * (rest - fits["truth"])) for name, rest in fits.items()}
        assert likelihoods["truth"] / likelihoods["turned"] == pytest.approx(ratio)
        chosen = best_first(proposals)[0]
        assert (equivalents_of(proposals, chosen, as_good) == ("turned",)) is stated


@dataclass
class Ledger:
    """What a search should be, kept by hand: accepted proposals with their rounds, scores, and what was let go."""

    search: Search[Scored]
    kept: list[tuple[Proposal[Scored], tuple[str, ...]]] = field(default_factory=list)
    weighed: list[Candidate] = field(default_factory=list)

    def accept(self, proposals: list[Proposal[Scored]], as_good: float) -> None:
        ranked = best_first(proposals)
        chosen = ranked[0]
        candidates = tuple(Candidate(each.name, each.evidence, "fitted") for each in ranked)
        near = equivalents_of(ranked, chosen, as_good)
        each = Round(ranked, chosen, candidates, near)
        step = Scored(self.search.current.score - chosen.evidence)
        self.search = replace(
            self.search,
            steps=(*self.search.steps, step),
            accepted=(*self.search.accepted, chosen),
            rounds=(*self.search.rounds, each),
        )
        self.kept.append((chosen, near))
        self.weighed += candidates

    def let_go(self, place: int, loss: float) -> None:
        less = Scored(self.search.current.score + loss)
        self.search = without_cause(self.search, place, less, "rejected", loss)
        gone = self.kept.pop(place)[0]
        self.weighed.append(Candidate(gone.name, loss, "rejected"))


MOVES = st.lists(st.tuples(PROPOSALS, st.booleans(), st.integers(0, 8)), max_size=6)


@given(MOVES, st.sampled_from([3.0, 30.0]))
def test_a_search_says_what_a_ledger_kept_by_hand_says(
    moves: list[tuple[list[Proposal[Scored]], bool, int]], as_good: float
) -> None:
    ledger = Ledger(Search((Scored(100.0),)))
    for proposals, lets_go, place in moves:
        ledger.accept(proposals, as_good)
        if lets_go and len(ledger.kept) > 1:
            ledger.let_go(place % (len(ledger.kept) - 1), 2.0)
    result, names = ledger.search, {each.name for each, _ in ledger.kept}
    assert result.base == Scored(100.0)
    assert result.current is result.steps[-1]
    assert len(result.steps) == len(result.accepted) + 1
    assert [id(each) for each in result.accepted] == [id(each) for each, _ in ledger.kept]
    evidence = [each.evidence for each in result.candidates]
    assert evidence == sorted(evidence, reverse=True)
    assert sorted(map(repr, result.candidates)) == sorted(map(repr, ledger.weighed))
    beside = [tuple(name for name in near if name not in names) for _, near in ledger.kept]
    assert result.equivalents == next((each for each in beside if each), ())


def test_names_beside_a_cause_that_was_let_go_are_not_told() -> None:
    """What imitated the first cause says nothing of the two that took its place."""
    ledger = Ledger(Search((Scored(100.0),)))
    ledger.accept([proposal("imitation", 30.0), proposal("its double", 29.0)], 10.0)
    assert ledger.search.equivalents == ("its double",)
    ledger.accept([proposal("play", 20.0), proposal("delay", 1.0)], 10.0)
    ledger.let_go(0, 1.0)
    assert [each.name for each in ledger.search.accepted] == ["play"]
    assert ledger.search.equivalents == ()


def test_a_name_that_was_accepted_too_is_told_apart() -> None:
    ledger = Ledger(Search((Scored(100.0),)))
    ledger.accept([proposal("play", 30.0), proposal("friction", 29.0), proposal("delay", 28.0)], 10.0)
    ledger.accept([proposal("friction", 20.0)], 10.0)
    assert ledger.search.equivalents == ("delay",)
