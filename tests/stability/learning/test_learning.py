"""Learning from cuts: against a posterior on a grid of the analytic limit, and in what must hold for any cuts."""

from dataclasses import replace
from math import nan, pi

import numpy as np
import pytest
from drawn_cuts import random_case
from numpy.typing import NDArray

from millfrf.core import TIP, InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import Learned, ProductionCut, learned_cut, learned_in_turn, learned_limits, multipliers
from millfrf.stability.drawn_structures import NormalErrors, drawn
from millfrf.stability.learning.approximation import Centre
from millfrf.stability.learning.production_cuts import Prediction, log_likelihood, predicted
from millfrf.stability.learning.sample import _moved, prior_sample
from millfrf.stability.settings import LEARNING
from modal_fit import ModalModel

Real = NDArray[np.float64]

# one mode in X: four straight teeth in a slot push it by -a Ktc krc (x - x_tau), whatever the spindle's angle
MASS, NATURAL, ZETA, KRC, KTC = 2.0, 2 * pi * 100, 0.03, 0.3, 1e9
DAMPED = NATURAL * np.sqrt(1 - ZETA**2)
MODEL = ModalModel(
    np.array([-ZETA * NATURAL + 1j * DAMPED]), np.array([[1 / (2j * MASS * DAMPED), 0, 0]]), np.eye(1, 3) + 0j, TIP, TIP
)
SLOT = MillingProcess(4, 0.02, pi / 2, KTC, KRC, 0.0, 0.0, pi, 1e-4, ktc_std=0.2 * KTC)
CHATTER = 1.05 * NATURAL  # rad/s, chatter frequency at the limit


def receptance(s: complex) -> complex:
    """G(s) of the mode, m/N."""
    return 1 / (MASS * (s**2 + 2 * ZETA * NATURAL * s + NATURAL**2))


LIMIT = -1 / (2 * KTC * KRC * receptance(1j * CHATTER).real)  # b_lim = -1 / (2 K Re G)
DELAY = (4 * pi - np.angle(1 + 1 / (LIMIT * KTC * KRC * receptance(1j * CHATTER)))) / CHATTER  # s, two waves a tooth
SPEED = 2 * pi / (4 * DELAY)


def growth(ktc: float, depth: float) -> float:
    """Real part of the rightmost root of ``1 + a K (1 - exp(-s tau)) G(s) = 0``, per tooth period, by Newton."""

    def loop(s: complex) -> complex:
        return 1 + depth * ktc * KRC * (1 - np.exp(-s * DELAY)) * receptance(s)

    roots = []
    for start in np.linspace(0.5, 1.6, 12) * NATURAL:
        s = complex(-1.0, start)
        for _ in range(40):
            s -= loop(s) / ((loop(s + 1e-3) - loop(s - 1e-3)) / 2e-3)
            if abs(s) > 5 * NATURAL:
                break
        else:
            roots += [s.real] if abs(loop(s)) < 1e-8 else []
    return float(max(roots) * DELAY)


def cut(name: str, share: float, verdict: str, frequency: float = nan) -> ProductionCut:
    """A cut at a share of the analytic limit."""
    return ProductionCut(name, SPEED, share * LIMIT, verdict, frequency, 0.1)


def learned(model: ModalModel, process: MillingProcess, cuts: list[ProductionCut]) -> Learned:
    """What is known after all cuts."""
    *_, last = learned_in_turn(model, process, cuts)
    return last


def test_growth_and_line_at_the_analytic_limit() -> None:
    result = predicted(
        [(MODEL, SLOT)], [cut("at", 1.0, "hopf"), cut("above", 1.2, "hopf"), cut("below", 0.8, "stable")]
    )
    turns = CHATTER * DELAY / (2 * pi)
    assert result.growth[0, 0] == pytest.approx(0.0, abs=1e-6)
    assert result.place[0, 0] == pytest.approx(abs(turns - round(turns)), abs=1e-6)
    assert result.growth[0, 1] == pytest.approx(growth(KTC, 1.2 * LIMIT), abs=1e-5)
    assert result.growth[0, 2] == pytest.approx(growth(KTC, 0.8 * LIMIT), abs=1e-5)
    assert result.period == pytest.approx(DELAY)


def test_posterior_of_one_coefficient_against_a_grid() -> None:
    cuts = [cut("a", 0.8, "stable"), cut("b", 1.25, "hopf"), cut("c", 1.0, "stable"), cut("d", 0.7, "inconclusive")]
    grid = np.linspace(0.3, 1.9, 161) * KTC
    weight = np.exp(-0.5 * ((grid - KTC) / (0.2 * KTC)) ** 2)
    for each in cuts[:3]:
        values = np.array([[growth(float(ktc), each.depth)] for ktc in grid])
        weight *= np.exp(log_likelihood(Prediction(values, 0 * values, np.array([DELAY])), [each])[:, 0])
    weight /= weight.sum()
    mean = weight @ grid
    error = np.sqrt(weight @ (grid - mean) ** 2)
    result = learned(MODEL, SLOT, cuts)
    ktc = np.array([process.ktc for _, process in result.after.draws()])
    of_sample = result.after.mean(ktc)
    assert abs(of_sample - mean) < 3 * error / np.sqrt(result.after.effective)
    assert np.sqrt(result.after.mean((ktc - of_sample) ** 2)) == pytest.approx(error, rel=0.15)
    assert result.updated()[1].ktc == pytest.approx(of_sample, rel=0.01)
    assert result.updated()[1].ktc_std == pytest.approx(error, rel=0.15)


def test_without_conclusive_cuts_nothing_is_learned() -> None:
    case = random_case(3)
    for cuts in ([], [replace(cut("x", 1.0, "inconclusive"), spindle_speed=float(case.speeds[3]))]):
        result = learned(case.model, case.cut, cuts)
        assert result.verdict == "nothing"
        assert result.updated() == (case.model, case.cut)
        assert result.after is result.before


def test_probabilities_of_verdicts_and_frequencies_add_up_to_one() -> None:
    values = np.linspace(-0.05, 0.3, 8)[:, None]
    prediction = Prediction(values, np.linspace(0.0, 0.5, 8)[:, None], np.array([0.01]))
    stable, chatter = (np.exp(log_likelihood(prediction, [cut("", 1.0, kind)])) for kind in ("stable", "hopf"))
    assert stable + chatter == pytest.approx(1.0)
    lines = np.linspace(200.0, 250.0, 4001)  # one half of 1 / period; the density is relative to an even one there
    widths = np.exp([log_likelihood(prediction, [cut("", 1.0, "hopf", float(line))])[:, 0] for line in lines])
    assert np.trapezoid(widths, lines, axis=0) / 50.0 == pytest.approx(chatter[:, 0], rel=0.03)


def test_chatter_frequency_moves_the_natural_frequency() -> None:
    errors = np.diag([0.0, (0.03 * DAMPED) ** 2, *np.zeros(12)])
    wide = replace(MODEL, covariance=errors)
    softer = replace(MODEL, poles=MODEL.poles.real + 0.97j * MODEL.poles.imag)
    value = multipliers(softer, SLOT, SPEED, 1.3 * LIMIT).values[0]
    frequency = (abs(np.angle(value)) / (2 * pi) + (2 if value.imag else 0)) / DELAY
    result = learned(wide, SLOT, [cut("far above", 1.3, "hopf", float(frequency))])
    before, after = NATURAL / (2 * pi), result.updated()[0].natural_frequencies[0]
    truth = softer.natural_frequencies[0]
    assert abs(after - truth) < 0.5 * abs(before - truth)
    assert result.narrowed[result.parameters.index("mode 1 frequency")] < 0.7
    assert result.evidence[0].shifts[0] == pytest.approx((after - before) / (0.03 * before), abs=0.3)


def test_a_contradiction_is_named_and_nothing_is_advised() -> None:
    cuts = [cut("a", 0.6, "stable"), cut("b", 1.3, "hopf"), cut("odd", 5.0, "stable")]
    *_, before, result = learned_in_turn(MODEL, SLOT, cuts)
    assert before.verdict == "learned"
    assert result.verdict == "contradiction"
    assert [text.partition(":")[0] for text in result.contradictions] == ["odd"]
    assert "another tool" in result.contradictions[0]
    limits = learned_limits(result, np.array([SPEED]), 0.02)
    with pytest.raises(InputError, match="contradict"):
        learned_cut(result, limits, confidence=0.975, drift=0.02)
    early = learned(MODEL, SLOT, [cut("deep", 1.55, "stable"), cut("c", 1.1, "hopf"), cuts[1]])
    assert early.evidence[0].expected_by_others < early.evidence[0].expected


def test_frequencies_of_another_structure_are_a_contradiction() -> None:
    wrong = (2 + 0.5) / DELAY
    cuts = [cut(name, 1.1 + 0.05 * k, "hopf", wrong) for k, name in enumerate("abcd")]
    errors = np.diag([0.0, (0.001 * DAMPED) ** 2, *np.zeros(12)])
    result = learned(replace(MODEL, covariance=errors), replace(SLOT, ktc_std=0.01 * KTC), cuts)
    assert result.verdict == "contradiction"
    assert "4 of 4 chatter frequencies" in result.contradictions[-1]


def test_the_approximation_draws_what_it_says() -> None:
    generator = np.random.default_rng(1)
    numbers = generator.standard_normal((4000, 6))
    numbers[:, :2] = numbers[:, :2] * [0.1, 0.3] + [1.0, -0.5]
    prediction = Prediction(numbers[:, :3], 0 * numbers[:, :3], np.zeros(3))
    centre = Centre.of(numbers, np.full(4000, 1 / 4000), prediction)
    assert np.linalg.norm(centre.directions[:2]) == pytest.approx(np.sqrt(2), rel=1e-3)
    near = centre.near(numbers, 0.5, generator)
    assert near.mean(axis=0) == pytest.approx(centre.whole_mean, abs=0.06)
    assert np.cov(near.T) == pytest.approx(centre.whole_covariance, abs=0.08)
    # the density over the prior's has the mean 1 under the prior
    prior = generator.standard_normal((200_000, 6))
    size = np.exp(centre.density(prior)) / np.sqrt(np.linalg.det(centre.covariance))
    assert size.mean() == pytest.approx(1.0, abs=0.05)


def test_numbers_give_the_draws_of_the_errors() -> None:
    case = random_case(5)
    errors, generator = NormalErrors.of(case.model, case.cut), np.random.default_rng(7)
    for structure, process in drawn(case.model, case.cut, 3, 7):
        again = errors.at(errors.numbers(generator))
        assert again == (structure, process)


def test_what_cannot_be_learned_is_refused() -> None:
    with pytest.raises(InputError, match="nothing can be learned"):
        learned(MODEL, replace(SLOT, ktc_std=0.0), [])
    with pytest.raises(InputError, match="use one of"):
        cut("x", 1.0, "chatter")
    with pytest.raises(InputError, match="above 0"):
        cut("x", 0.0, "stable")


def test_few_effective_draws_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from millfrf.stability.learning import sample

    monkeypatch.setattr(sample, "LEARNING", replace(LEARNING, least_effective=201))
    with pytest.raises(InputError, match="effective structures of 200"):
        learned(MODEL, SLOT, [cut("a", 0.9, "stable")])


@pytest.mark.parametrize("seed", range(4, 8))
def test_half_of_the_moved_draws_differ(seed: int) -> None:
    """After a frequency that few draws explain; with seed 5 draws moved far while 84 of 200 were effective."""
    generator = np.random.default_rng(seed)
    errors = np.diag([(0.04 * NATURAL) ** 2, (0.04 * DAMPED) ** 2, *np.zeros(12)])
    prior = NormalErrors.of(replace(MODEL, covariance=errors), SLOT)
    known = [ProductionCut("far above", SPEED, 1.1 * LIMIT, "hopf", CHATTER / (2 * pi), 0.01)]
    sample = prior_sample(prior, generator)
    sample = replace(sample, prediction=sample.prediction.with_cut(predicted(sample.draws(), known)))
    sample = replace(sample, log_weights=log_likelihood(sample.prediction, known)[:, 0])
    assert sample.effective < 50
    assert _moved(sample, known, 1.0, generator).effective >= LEARNING.enough * LEARNING.draws
