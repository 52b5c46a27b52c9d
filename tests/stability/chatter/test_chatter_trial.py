"""Random cuts of an independent simulator with noise, runout, tones and wrong speeds: false alarms and misses."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from milling_simulator import simulate
from random_cuts import DisturbedCut, depth_with, fitted, random_cut, random_structure, seen_from_afar

from millfrf.stability import ChatterVerdict, ModelledCut, classify_cut

CHATTER = ("hopf", "period-doubling")
BY_MODEL = ("near a mode", "with the model")
"""In the reason of verdicts that stand on the model."""


@dataclass
class Score:
    """Numbers of cuts: stable and unstable, told right, told wrong; all others are inconclusive."""

    stable: int = 0
    unstable: int = 0
    false_alarms: int = 0
    called_stable: int = 0
    undecided_stable: int = 0
    undecided_unstable: int = 0

    @property
    def misses(self) -> int:
        """Unstable cuts that are not called chatter, inconclusive ones among them."""
        return self.called_stable + self.undecided_unstable


def judge(cut: DisturbedCut, *, with_model: bool = True) -> ChatterVerdict:
    """As the command does with a cutting file, and with or without ``--model``, which is no better than a fit."""
    known = fitted(cut.cut, np.random.default_rng(cut.cut.seed)) if with_model else cut.cut
    return classify_cut(
        cut.samples,
        cut.rate,
        cut.stated_speed,
        cut.cut.teeth,
        runout=cut.cut.runout,
        derivatives=(2, 2),
        natural_frequencies=tuple(known.frequencies) if with_model else (),
        chip=cut.cut.process.thickest_chip,
        constant_force=cut.cut.process.has_constant_force,
        modelled=ModelledCut(known.process, known.model, (0, 1)) if with_model else None,
    )


def note(score: Score, cut: DisturbedCut, found: ChatterVerdict) -> None:
    """Add a verdict."""
    undecided = found.kind == "inconclusive"
    if abs(cut.multiplier) < 1:
        score.stable += 1
        score.false_alarms += found.kind in CHATTER
        score.undecided_stable += undecided
    else:
        score.unstable += 1
        score.called_stable += found.kind == "stable"
        score.undecided_unstable += undecided


def test_the_simulator_decays_as_the_multipliers_say() -> None:
    """So that the trial's truth and its simulator, which share nothing, stand for the same cuts."""
    rng = np.random.default_rng(0)
    for _ in range(3):
        cut = random_structure(rng)
        cut = replace(cut, depth=depth_with(cut, 0.97), feed=1e-3)
        places = 400
        motion = simulate(cut, 300, cut.rpm / 60 * cut.teeth * places, steps=places).acceleration
        periods = motion[: len(motion) // places * places].reshape(-1, 2 * places)
        change = np.linalg.norm(np.diff(periods, axis=0), axis=1)[60:200]
        rate = np.exp(np.polyfit(np.arange(len(change)), np.log(change), 1)[0])
        assert rate == pytest.approx(0.97, abs=0.002)


@pytest.mark.long
def test_eight_random_cuts() -> None:
    score = Score()
    for number in range(8):
        rng = np.random.default_rng([15, number])
        cut = random_cut(rng, stable=number % 2 == 0)
        note(score, cut, judge(cut))
    assert (score.stable, score.unstable, score.false_alarms, score.misses) == (4, 4, 0, 0)


@pytest.mark.slow
def test_two_hundred_random_cuts(capsys: pytest.CaptureFixture[str]) -> None:
    with_model, without = Score(), Score()
    for number in range(200):
        cut = random_cut(np.random.default_rng([2028, number]), stable=number % 2 == 0)
        verdict = judge(cut)
        blind = judge(cut, with_model=False) if any(words in verdict.reason for words in BY_MODEL) else verdict
        note(with_model, cut, verdict)
        note(without, cut, blind)
        with capsys.disabled():
            if (blind.kind == "stable") != (abs(cut.multiplier) < 1) or blind.kind == "inconclusive":
                stated = f"{cut.cut.teeth} teeth, {blind.kind}: {blind.reason}"
                print(f"cut {number}: multiplier {cut.multiplier:.3f}, {stated}")
    with capsys.disabled():
        print(f"with the model: {with_model}", f"without: {without}", sep="\n")
    for score in (with_model, without):
        assert (score.stable, score.unstable) == (100, 100)
        assert score.false_alarms <= 1
        assert score.misses <= 5


def judged_from_afar(number: int) -> tuple[DisturbedCut, ChatterVerdict]:
    """A drawn cut, and the verdict on it from sensors away from the tool, without chip, runout or model."""
    cut = random_cut(np.random.default_rng([3031, number]), stable=number % 2 == 0)
    far = seen_from_afar(cut, np.random.default_rng([7, number]))
    return cut, classify_cut(far.samples, far.rate, far.stated_speed, far.cut.teeth)


@pytest.mark.long
def test_six_cuts_seen_from_afar() -> None:
    score = Score()
    for number in range(12, 18):
        note(score, *judged_from_afar(number))
    assert (score.false_alarms, score.called_stable) == (0, 0)
    assert score.undecided_stable + score.undecided_unstable <= 3


@pytest.mark.slow
def test_a_hundred_cuts_seen_from_afar(capsys: pytest.CaptureFixture[str]) -> None:
    score = Score()
    for number in range(100):
        note(score, *judged_from_afar(number))
    with capsys.disabled():
        print(f"sensors away from the tool: {score}")
    assert (score.stable, score.unstable) == (50, 50)
    assert score.false_alarms <= 1
    assert score.called_stable <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "least_doubted"), [(3.0, 24), (1.05, 26), (0.5, 18)])
def test_wrong_speeds_of_thirty_stable_cuts(
    factor: float, least_doubted: int, capsys: pytest.CaptureFixture[str]
) -> None:
    kinds = []
    for number in range(0, 60, 2):
        cut = random_cut(np.random.default_rng([2028, number]), stable=True)
        wrong = factor * cut.stated_speed
        if len(cut.samples) / cut.rate * wrong / (2 * np.pi) > 41:
            stated = classify_cut(
                cut.samples, cut.rate, wrong, cut.cut.teeth, runout=cut.cut.runout, derivatives=(2, 2)
            )
            kinds.append(stated.kind)
    with capsys.disabled():
        print(f"speed times {factor:g}: { ({kind: kinds.count(kind) for kind in set(kinds)}) }")
    assert kinds.count("inconclusive") >= least_doubted
    assert sum(kinds.count(kind) for kind in CHATTER) <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "least_found"), [(3.0, 0.95), (2.0, 0.9), (0.5, 0.85), (1.05, 0.95), (0.95, 0.95)])
def test_wrong_speeds_that_nothing_measured(
    factor: float, least_found: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong speed is found where the verdict is open, or says another speed, or is at the true speed.

    The aim of 0.95 is missed at twice and at half the speed (docs/chatter.md): their bounds only keep what is reached.
    """
    kinds = []
    for number in range(0, 120, 2):
        cut = random_cut(np.random.default_rng([2028, number]), stable=True)
        wrong = factor * cut.stated_speed
        too_fast = cut.cut.teeth * wrong / (2 * np.pi) > cut.rate / 2
        if too_fast or len(cut.samples) / cut.rate * wrong / (2 * np.pi) < 41:
            continue
        stated = classify_cut(
            cut.samples, cut.rate, wrong, cut.cut.teeth, runout=cut.cut.runout, derivatives=(2, 2), only_stated=True
        )
        at_true_speed = abs(stated.spindle_speed * 30 / np.pi / cut.cut.rpm - 1) < 0.01
        told_so = at_true_speed or any("speed is" in warning for warning in stated.warnings)
        kinds.append(stated.kind + " at the true speed or with a word on it" * told_so)
    is_doubted = [kind != "stable" and kind not in CHATTER for kind in kinds]
    with capsys.disabled():
        print(f"speed times {factor:g}: { ({kind: kinds.count(kind) for kind in set(kinds)}) }")
    assert np.mean(is_doubted) >= least_found
    assert sum(kind in CHATTER for kind in kinds) <= 2
