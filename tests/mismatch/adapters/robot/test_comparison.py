"""Which change a round chooses, by fits and errors made by hand; evidence and pruning on a small case."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import ROBOT, small_case

from millfrf.mismatch import ROBOT as SETTINGS
from millfrf.mismatch.inference.search import Proposal, Round, Search
from millfrf.mismatch.robot import diagnosis as module
from millfrf.mismatch.robot.diagnosis import NO_GAIN, RobotComparison
from millfrf.mismatch.robot.fit import FreeFit, RobotFit, fit_from, free_fit, numbered
from millfrf.mismatch.robot.posed import Changes
from millfrf.mismatch.robot.results import HeldOutTest, folds_of
from millfrf.robot_model import possible_changes, with_joint_factor

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
FIRST, SECOND, THIRD = "joint 3 stiffness", "payload", "links"
NOTHING = RobotFit((), (), 1000.0, 0.0, 0.0, 0.0, np.zeros(0), (), 50.0)
FREE = FreeFit(replace(NOTHING, misfit=400.0), ())


def made_fit(name: str, cost: float, price: float = 5.0) -> RobotFit:
    changes = numbered(CHANGES[name], CHANGES[name].neutral)
    return RobotFit(changes, (), cost, 0.0, 0.0, price, np.ones(len(changes)), (), 50.0)


def errors(size: float, blocks: int = 20) -> HeldOutTest:
    """The same error on two recordings, in blocks that scatter a little."""
    scatter = np.random.default_rng(0).uniform(0.9, 1.1, blocks)
    return HeldOutTest(np.zeros((2, 0)), np.full(2, size), np.full(2, 0.01), (size**2 * scatter,) * 2)


def round_of(
    monkeypatch: pytest.MonkeyPatch, weighed: dict[str, tuple[float, float]], postures: int = 2
) -> tuple[RobotComparison, Search[RobotFit]]:
    """A comparison in which each change has a cost and an error held out; without a change 1000 and 0.5."""
    fits = {name: made_fit(name, cost) for name, (cost, _) in weighed.items()}
    sizes: dict[Changes, float] = {(): 0.5} | {fits[name].changes: size for name, (_, size) in weighed.items()}
    monkeypatch.setattr(module, "fit_from", lambda robot, start, free: fits[start[0][0].name])
    monkeypatch.setattr(module, "best_start", lambda robot, before, change: (numbered(change, change.neutral), np.inf))
    monkeypatch.setattr(module, "held_out_test", lambda folds, changes: errors(sizes[changes]))
    changes = tuple(CHANGES[name] for name in weighed)
    comparison = RobotComparison(SETTINGS, small_case(count=postures), changes, FREE, ())
    return comparison, Search((NOTHING,))


def test_the_best_evidence_is_chosen_where_it_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, result = round_of(monkeypatch, {FIRST: (800.0, 0.1), SECOND: (803.0, 0.1), THIRD: (900.0, 0.1)})
    item = comparison.round(result)
    assert item.chosen is not None
    assert item.chosen.name == FIRST
    assert item.chosen.evidence == NOTHING.score - made_fit(FIRST, 800.0).score == 195.0
    assert [each.name for each in item.proposals] == [FIRST, SECOND, THIRD]
    assert item.equivalents == (SECOND,)  # 3 below the best; 6 are allowed
    assert {each.stage for each in item.candidates} == {"fitted"}


def test_a_change_that_does_not_hold_elsewhere_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, result = round_of(monkeypatch, {FIRST: (800.0, 0.6), SECOND: (803.0, 0.4), THIRD: (985.0, 0.1)})
    item = comparison.round(result)
    assert item.chosen is not None
    assert item.chosen.name == SECOND
    stages = {each.name: each.stage for each in item.candidates}
    assert stages == {FIRST: NO_GAIN, SECOND: "fitted", THIRD: "fitted"}  # the last lacks the evidence to be tested
    assert item.equivalents == ()
    nothing, result = round_of(monkeypatch, {FIRST: (985.0, 0.1)})
    assert nothing.round(result).chosen is None


@pytest.mark.parametrize(("postures", "name"), [(2, SECOND), (1, FIRST)])
def test_in_several_postures_a_change_is_beaten_elsewhere(
    monkeypatch: pytest.MonkeyPatch, postures: int, name: str
) -> None:
    comparison, result = round_of(monkeypatch, {FIRST: (800.0, 0.3), SECOND: (802.0, 0.1)}, postures)
    item = comparison.round(result)
    assert item.chosen is not None
    assert item.chosen.name == name
    stages = {each.name: each.stage for each in item.candidates}
    beaten = f"beaten by {SECOND} on what was held out"
    assert stages[FIRST] == (beaten if postures == 2 else "fitted")
    assert item.equivalents == (() if postures == 2 else (SECOND,))


def test_a_later_change_may_be_beaten_by_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, result = round_of(monkeypatch, {FIRST: (800.0, 0.1), SECOND: (802.0, 0.3)})
    item = comparison.round(result)
    assert {each.name: each.stage for each in item.candidates}[SECOND] == f"beaten by {FIRST} on what was held out"
    assert item.equivalents == ()


def test_a_fit_that_ends_higher_pays_its_price_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, result = round_of(monkeypatch, {FIRST: (1400.0, 0.1)})
    assert comparison.round(result).proposals[0].evidence == -5.0


def test_a_search_ends_where_the_excess_passes_for_noise() -> None:
    comparison = RobotComparison(SETTINGS, small_case(), (), FREE, ())
    assert comparison.excess(NOTHING) == (1000.0 - 400.0) / 50.0
    quiet = replace(NOTHING, misfit=499.0)  # 1.98 times what a right model's modes are off
    loud = replace(NOTHING, misfit=501.0)
    nothing: Round[RobotFit] = Round((), None, ())
    assert not comparison.finished(Search((quiet,)))  # one round is made in any case
    assert comparison.finished(Search((NOTHING, quiet), rounds=(nothing,)))
    assert not comparison.finished(Search((NOTHING, loud), rounds=(nothing,)))


def test_without_a_change_its_companions_are_gone_too(monkeypatch: pytest.MonkeyPatch) -> None:
    comparison, _ = round_of(monkeypatch, {FIRST: (800.0, 0.1)})
    both = replace(NOTHING, changes=(*made_fit(SECOND, 0.0).changes, *made_fit(FIRST, 0.0).changes))
    accepted = tuple(Proposal(name, {}, both, 30.0) for name in (SECOND, FIRST))
    kept: list[Changes] = []
    monkeypatch.setattr(module, "fit_from", lambda robot, start, free: kept.append(start) or NOTHING)
    comparison.without(Search((NOTHING, both, both), accepted), 0)
    comparison.without(Search((NOTHING, both, both), accepted), 1)
    assert [[each.name for each, _ in changes] for changes in kept] == [
        [FIRST],
        [each.name for each, _ in numbered(CHANGES[SECOND], 0.0)],
    ]


def test_a_real_round_names_the_softer_joint_by_a_difference_of_scores() -> None:
    case = small_case(with_joint_factor(ROBOT, "3", 0.7))
    weighed = (CHANGES["joint 5 stiffness"], CHANGES[FIRST])
    free = free_fit(case, ((CHANGES[FIRST], 0.7),))
    comparison = RobotComparison(SETTINGS, case, weighed, free, folds_of(case, free, ((CHANGES[FIRST], 0.7),)))
    base = fit_from(case, (), free)
    single = comparison.round(Search((base,)))
    assert single.proposals[0].name == FIRST
    assert single.proposals[0].evidence == pytest.approx(base.score - single.proposals[0].fitted.score)
    assert base.score == base.cost
    tested = comparison.held_out(())
    assert comparison.held_out(()) is tested  # a hypothesis is tested once
