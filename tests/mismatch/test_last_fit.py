"""The last fit counts every recording alike: it predicts better where a law has another form, and is left out else."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_joint import at_the_joint, law_of
from one_mode_rig import Rig, steady

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, fit
from millfrf.mismatch.inference.search import Search
from millfrf.mismatch.models.fitting import Fit, even_fit, plain_fit
from millfrf.mismatch.records.bands import Recordings, compared_band, compared_lines
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.answer import Answer
from millfrf.mismatch.structure.held_out import held_out_improvement, recordings_of
from millfrf.mismatch.structure.prediction import last_fit
from millfrf.mismatch.structure.structured_residual import remainder_of

LEVELS = (1.0, 4.0)
RIG = Rig().stiffened(0.3, 4.0)


def _read() -> list[WindowedSpectrum]:
    """Two levels of a cubic spring that repeat, so that their noise is known."""
    band = compared_band(RIG.model, RIG.rate, None)
    return [compared_lines(steady(RIG, f"level_{level:g}", level, 5), band, 1.0)[0] for level in LEVELS]


def _answer(law: str, values: list[float]) -> tuple[Answer, Recordings]:
    """What is told where a law was fitted."""
    lines = _read()
    shape = ModelShape(RIG.model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=15)
    begun = base.hypothesis.nominal.with_cause(at_the_joint(law_of(law), np.array(values)))
    fitted = fit(lines, begun, iterations=40)
    both = recordings_of(lines, lines, base.hypothesis)
    worth = held_out_improvement(both, fitted.hypothesis, fitted.noises, (), Settings().proof)
    result = Search((base, fitted))
    return Answer("partly explained", (), fitted, result, remainder_of(fitted.hypothesis, lines), worth), both


@pytest.mark.long
def test_a_law_of_another_form_predicts_better() -> None:
    answer, both = _answer("backlash", [0.3 * RIG.stiffness, 1e-4])
    assert answer.held_out.improvement.after > 1.5 * answer.held_out.improvement.noise_floor
    last = last_fit(answer, both, (), Settings().proof)
    assert last.answer is not answer
    for each in ("improvement", "everywhere"):
        assert getattr(last.answer.held_out, each).after < getattr(answer.held_out, each).after
    assert "every recording has equal weight" in last.sentence
    # its score is a likelihood's, under noise of its own, and so it is worse than the likeliest
    assert answer.final.score < last.answer.final.score < np.inf


def test_the_true_law_is_left_as_it_is() -> None:
    answer, both = _answer("stiffness_hardening", [1e-9 * RIG.cubic, 3.0])
    assert answer.held_out.improvement.after < 1.5 * answer.held_out.improvement.noise_floor
    last = last_fit(answer, both, (), Settings().proof)
    assert last.answer is answer
    assert last.sentence == ""


def test_levels_count_alike_whatever_their_size() -> None:
    """A linear model of two unlike rigs: ten times the force of one changes nothing but for plain least squares."""
    rigs = Rig(), replace(Rig(), frequency=10.4)
    band = band_of(RIG.model, RIG.rate)
    first, second = (rig.recordings((1.0,), 40.0)[0] for rig in rigs)
    shape = ModelShape(Rig().model, LabError())

    def frequencies(factor: float) -> tuple[float, float]:
        louder = replace(second, force=factor * second.force, response=factor * second.response)
        lines = [windowed_spectrum(each, band, 1.0) for each in (first, louder)]
        begun = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=3)
        even: Fit = even_fit(lines, begun, iterations=30)
        plain = plain_fit(lines, begun.hypothesis, iterations=30)
        return tuple(float(each.hypothesis.model.natural_frequencies[0]) for each in (even, plain))

    (even, plain), (even_loud, plain_loud) = frequencies(1.0), frequencies(10.0)
    assert even_loud == pytest.approx(even, abs=1e-3)
    assert plain_loud - plain > 0.05
