"""Forward selection and pruning of terms in a polynomial regression, against brute force over all subsets."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.mismatch import Candidate, SearchSettings, Settings
from millfrf.mismatch.inference.search import (
    Proposal,
    Round,
    Search,
    best_first,
    equivalents_of,
    search,
    without_cause,
    without_causes,
)
from millfrf.mismatch.inference.settings import EvidenceSettings

Real = NDArray[np.float64]
Terms = tuple[str, ...]

SETTINGS = Settings(evidence=EvidenceSettings(least=8.0), search=SearchSettings(most_causes=5))


@dataclass(frozen=True)
class PolynomialFit:
    """Terms with their least-squares coefficients; noise has variance 1."""

    terms: Terms
    rest: float
    values: int

    @property
    def score(self) -> float:
        return self.rest + len(self.terms) * float(np.log(self.values))


@dataclass(frozen=True)
class Regression:
    """Which columns does y hold? Each column is a cause with one number."""

    columns: dict[str, Real]
    y: Real
    settings: Settings = SETTINGS
    enough: float = 0.0
    told: list[str] = field(default_factory=list)

    def fit(self, terms: Iterable[str]) -> PolynomialFit:
        names = tuple(terms)
        table = np.array([self.columns[name] for name in names]).reshape(len(names), len(self.y)).T
        rest = self.y - table @ np.linalg.lstsq(table, self.y, rcond=None)[0] if names else self.y
        return PolynomialFit(names, float(rest @ rest), len(self.y))

    def finished(self, found: Search[PolynomialFit]) -> bool:
        return found.current.rest < self.enough

    def round(self, found: Search[PolynomialFit]) -> Round[PolynomialFit]:
        here = found.current
        proposals = []
        for name in self.columns:
            if name not in here.terms:
                fitted = self.fit((*here.terms, name))
                proposals.append(Proposal(name, {}, fitted, here.score - fitted.score))
        ranked = best_first(proposals)
        good = [each for each in ranked if each.evidence >= self.needed(here, found.base)]
        chosen = good[0] if good else None
        candidates = tuple(Candidate(each.name, each.evidence, "fitted") for each in ranked)
        near = equivalents_of(ranked, chosen, self.settings.evidence.as_good) if chosen else ()
        return Round(ranked, chosen, candidates, near)

    def without(self, found: Search[PolynomialFit], place: int) -> PolynomialFit:
        return self.fit(name for name in found.current.terms if name != found.accepted[place].name)

    def needed(self, current: PolynomialFit, base: PolynomialFit) -> float:
        return self.settings.evidence.least

    def best_subset(self) -> Terms:
        """The subset with the least score, each term paying the evidence that it needs."""
        subsets = [one for size in range(len(self.columns) + 1) for one in combinations(self.columns, size)]
        return min(subsets, key=lambda one: self.fit(one).score + self.settings.evidence.least * len(one))

    def searched(self) -> Search[PolynomialFit]:
        return search(self, self.fit(()), self.told.append)


def orthogonal(order: int = 6, count: int = 64) -> dict[str, Real]:
    """Chebyshev's polynomials at his nodes: their columns are orthogonal, so that greedy selection is the best one."""
    x = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return {f"T{n}": np.polynomial.Chebyshev.basis(n)(x) for n in range(order)}


@pytest.mark.parametrize("seed", range(12))
def test_forward_selection_finds_the_best_of_all_subsets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = orthogonal()
    sizes = rng.choice([0.0, 0.4, 0.9, 2.0], size=len(columns))
    y = sum(size * column for size, column in zip(sizes, columns.values(), strict=True)) + rng.normal(size=64)
    problem = Regression(columns, y, replace(SETTINGS, search=SearchSettings(most_causes=6)))
    result = problem.searched()
    assert set(result.current.terms) == set(problem.best_subset())
    assert [each.name for each in result.accepted] == list(result.current.terms)
    assert len(result.steps) == len(result.accepted) + 1
    # most evidence comes first, and every step gains what it promised
    gains = [each.score - other.score for each, other in zip(result.steps, result.steps[1:], strict=False)]
    assert gains == pytest.approx([each.evidence for each in result.accepted])
    assert gains == sorted(gains, reverse=True)


def imitated() -> Regression:
    """A column that looks like the sum of two others wins the first round, and is needless once both are there."""
    rng = np.random.default_rng(2)
    columns = orthogonal()
    columns["imitation"] = columns["T1"] + columns["T3"] + 0.5 * orthogonal(10)["T9"]  # which no column mends
    y = 3 * columns["T1"] + 3.2 * columns["T3"] + rng.normal(size=64)
    return Regression(columns, y)


def test_pruning_lets_go_of_what_only_imitated_the_others() -> None:
    problem = imitated()
    result = problem.searched()
    assert next(each.chosen.name for each in result.rounds if each.chosen) == "imitation"
    assert set(result.current.terms) == {"T1", "T3"} == set(problem.best_subset())
    assert {each.name for each in result.accepted} == {"T1", "T3"}
    assert len(result.steps) == 3
    assert result.steps[-1] == result.current
    assert [(each.name, each.stage) for each in result.rejected] == [("imitation", "rejected")]
    assert result.rejected[0].evidence < SETTINGS.evidence.least
    assert result.candidates[0].evidence == max(each.evidence for each in result.candidates)
    assert problem.told[0] == "causes, round 1"
    assert problem.told[-1] == "redundant causes"


def test_a_search_ends_with_the_fit_that_is_left_when_its_last_cause_goes() -> None:
    """The step before may still hold a cause that was let go in between."""
    problem = imitated()
    result = problem.searched()
    less = problem.fit((result.accepted[0].name,))
    left = without_cause(result, 1, less, "not confirmed", 0.0)
    assert left.current is less
    assert len(left.steps) == len(left.accepted) + 1
    assert without_cause(left, 0, less, "not confirmed", 0.0).steps == (result.base,)


def test_a_search_that_lets_go_of_all_causes_says_why() -> None:
    result = imitated().searched()
    left = without_causes(result, "not confirmed")
    assert left.current is result.base
    assert left.accepted == ()
    names = [each.name for each in result.accepted]
    assert [(each.name, each.stage) for each in left.rejected[-2:]] == [(name, "not confirmed") for name in names]


def test_the_last_cause_is_never_pruned() -> None:
    columns = {"one": np.ones(50)}
    problem = Regression(columns, 2 * columns["one"])
    assert problem.searched().current.terms == ("one",)


def test_a_search_ends_where_nothing_is_worth_it_or_enough_is_found() -> None:
    quiet = Regression(orthogonal(), np.random.default_rng(0).normal(size=64)).searched()
    assert quiet.accepted == ()
    assert quiet.current is quiet.base
    assert len(quiet.rounds) == 1
    assert quiet.rounds[0].chosen is None
    assert quiet.equivalents == ()
    item = replace(imitated(), settings=replace(SETTINGS, search=SearchSettings(most_causes=1))).searched()
    assert [each.name for each in item.accepted] == ["imitation"]
    enough = imitated()
    ended = replace(enough, enough=enough.fit(("imitation",)).rest + 1e-9).searched()
    assert [each.name for each in ended.accepted] == ["imitation"]
    assert len(ended.rounds) == 1


def test_equivalents_are_those_within_a_likelihood_ratio() -> None:
    columns = orthogonal()
    columns["twin"] = columns["T2"] + 1e-3 * columns["T4"]
    result = Regression(columns, 2 * columns["T2"] + np.random.default_rng(1).normal(size=64)).searched()
    pair = {"T2", "twin"}
    assert {result.accepted[0].name, *result.equivalents} == pair
