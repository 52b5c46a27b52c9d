"""A fourth kind of comparison is a day's work: readings of a balance against known weights, from search to file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.mismatch import AcceptedCause, Candidate, Diagnosis, Settings, read_diagnosis, write_diagnosis
from millfrf.mismatch.inference.diagnosis import Findings, Improvement, Remainder, verdict_of
from millfrf.mismatch.inference.numerics import Limits, descend, plain_step, ratio_interval, signed_ranks
from millfrf.mismatch.inference.search import Proposal, Round, Search, best_first, equivalents_of, search

Real = NDArray[np.float64]

NOISE = 0.01
CAUSES = {"zero_error": lambda w: np.ones_like(w), "gain_error": lambda w: w, "bent_beam": lambda w: w**2}


@dataclass(frozen=True)
class Weighing:
    """A hypothesis, ``reading = weight + sum number_k cause_k(weight)``, fitted to every other reading."""

    weights: Real
    readings: Real
    causes: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()

    def residual(self, part: slice) -> Real:
        """Readings less predicted ones, in units of the noise."""
        columns = [number * CAUSES[name](self.weights) for name, number in zip(self.causes, self.numbers, strict=True)]
        return (self.readings - self.weights - sum(columns, np.zeros(len(self.weights))))[part] / NOISE

    @property
    def score(self) -> float:
        rest = self.residual(slice(0, None, 2))
        return float(rest @ rest) + len(self.causes) * float(np.log(len(rest)))


class LeastSquares:
    """The hypothesis as the descent sees it."""

    def cost(self, state: Weighing) -> float:
        return state.score

    def normal_equations(self, state: Weighing) -> tuple[Real, Real]:
        columns = np.array([CAUSES[name](state.weights)[::2] / NOISE for name in state.causes])
        return columns @ columns.T, columns @ state.residual(slice(0, None, 2))

    def step(self, state: Weighing, matrix: Real, gradient: Real) -> Real:
        return plain_step(matrix, gradient)

    def moved(self, state: Weighing, step: Real) -> Weighing:
        numbers = tuple(float(old + new) for old, new in zip(state.numbers, step, strict=True))
        return Weighing(state.weights, state.readings, state.causes, numbers)

    def settled(self, state: Weighing) -> Weighing:
        return state


def fitted(start: Weighing, causes: tuple[str, ...]) -> Weighing:
    begin = Weighing(start.weights, start.readings, causes, (0.0,) * len(causes))
    return descend(LeastSquares(), begin, Limits(tolerance=1e-6)).state if causes else begin


@dataclass(frozen=True)
class Balance:
    """What the comparison of a balance gives to the search."""

    settings: Settings

    def finished(self, found: Search[Weighing]) -> bool:
        return False

    def round(self, found: Search[Weighing]) -> Round[Weighing]:
        here = found.current
        further = [fitted(here, (*here.causes, name)) for name in CAUSES if name not in here.causes]
        ranked = best_first([Proposal(each.causes[-1], {}, each, here.score - each.score) for each in further])
        good = [each for each in ranked if each.evidence > self.needed(here, found.base)]
        weighed = tuple(Candidate(each.name, each.evidence, "fitted") for each in ranked)
        near = equivalents_of(ranked, good[0], self.settings.evidence.as_good) if good else ()
        return Round(ranked, good[0] if good else None, weighed, near)

    def without(self, found: Search[Weighing], place: int) -> Weighing:
        kept = [name for k, name in enumerate(found.current.causes) if k != place]
        return fitted(found.current, tuple(kept))

    def needed(self, current: Weighing, base: Weighing) -> float:
        return self.settings.evidence.least


def left_of(one: Weighing) -> Remainder:
    """Power beyond noise on the readings that were fitted, as a share of what is left and in units of the noise."""
    power = float(np.mean(one.residual(slice(0, None, 2)) ** 2))
    return Remainder(max(power - 1.3, 0.0) / power, max(power - 1.0, 0.0))


def diagnose_balance(weights: Real, readings: Real) -> Diagnosis[Search[Weighing]]:
    settings = Settings()
    result = search(Balance(settings), Weighing(weights, readings), lambda text: None)
    held_out = slice(1, None, 2)
    before, after = (each.residual(held_out) ** 2 for each in (result.base, result.current))
    size = float(np.sqrt(np.mean(readings[held_out] ** 2)))
    errors = [float(np.sqrt(np.mean(power))) * NOISE / size for power in (before, before, after)]
    chance = signed_ranks(before, after)
    gain = Improvement("odd readings", *errors, NOISE / size, chance, ratio_interval(before, after))
    named = bool(result.accepted) and chance < settings.proof.significance
    left = left_of(result.base), left_of(result.current)
    verdict = verdict_of(Findings(*left, named), settings.verdict)
    stated = [
        AcceptedCause(each.name, {}, {each.name: number}, {}, each.evidence)
        for each, number in zip(result.accepted, result.current.numbers, strict=True)
    ]
    return Diagnosis(
        "balance",
        verdict,
        tuple(stated),
        result.candidates,
        result.equivalents,
        gain,
        *left,
        {"readings": "all"},
        result,
    )


@pytest.mark.parametrize(
    ("truth", "verdict"),
    [
        ({}, "none"),
        ({"zero_error": 0.2}, "explained"),
        ({"gain_error": 0.05, "bent_beam": -0.02}, "explained"),
    ],
)
def test_a_new_kind_names_what_was_concealed(truth: dict[str, float], verdict: str, tmp_path: Path) -> None:
    weights = np.linspace(0.5, 5.0, 120)
    wrong = sum((number * CAUSES[name](weights) for name, number in truth.items()), np.zeros(120))
    readings = weights + wrong + NOISE * np.random.default_rng(7).normal(size=120)
    result = diagnose_balance(weights, readings)
    assert result.verdict == verdict
    assert {cause.name for cause in result.physics} == set(truth)
    for cause in result.physics:
        assert cause.parameters[cause.name] == pytest.approx(truth[cause.name], abs=4e-3)
    write_diagnosis(tmp_path / "diagnosis.json", result)
    again = read_diagnosis(tmp_path / "diagnosis.json")
    assert (again.compared, again.verdict, again.physics) == ("balance", result.verdict, result.physics)


def test_what_no_cause_explains_is_left_unexplained() -> None:
    weights = np.linspace(0.5, 5.0, 120)
    result = diagnose_balance(weights, weights + 0.2 * np.sin(40 * weights))
    assert result.verdict == "unexplained"
