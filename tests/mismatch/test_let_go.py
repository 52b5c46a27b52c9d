"""Causes that are let go of: modes without damping, and those without which the others run away."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hidden_joint import law_of, with_law
from one_mode_rig import Rig

from estimation import windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, fit, library
from millfrf.mismatch.inference.diagnosis import Candidate
from millfrf.mismatch.inference.search import Proposal, Search
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure import held_out as confirmation
from millfrf.mismatch.structure.acceptance import impossible_rival, unproved_law
from millfrf.mismatch.structure.added_modes import copies_of_modes, harmonics_of_modes, undamped_modes
from millfrf.mismatch.structure.comparison import StructureComparison
from millfrf.mismatch.structure.held_out import fit_without, held_out_improvement, recordings_of
from millfrf.mismatch.structure.structured_residual import remainder_of
from modal_fit import ModalModel


@dataclass(frozen=True)
class _Comparison:
    """A comparison in which the fit without a cause is known."""

    less: Fit

    def refitted_without(self, search: Search[Fit], place: int) -> Fit:
        return self.less


def test_a_mode_without_damping_is_told_by_its_errors() -> None:
    mode = _search().current
    shape = mode.hypothesis.shape
    at = shape.nominal_modes * shape.per_mode + 1
    for error, gone in ((0.1, []), (10.0, [1])):
        covariance = mode.covariance.copy()
        covariance[at, at] = (error / shape.lab.damping) ** 2
        assert undamped_modes(replace(mode, covariance=covariance)) == gone


@pytest.mark.parametrize(("law", "at_harmonic"), [("coulomb_friction", [1]), ("pose_drift", [])])
def test_an_added_mode_at_a_harmonic_counts_only_under_a_nonlinear_joint(law: str, at_harmonic: list[int]) -> None:
    """The bands of half power of twice the frequency and of the added mode overlap, or do not."""
    shape = ModelShape(Rig().model, LabError())
    values = {"coulomb_friction": [3.0, 2e-3], "pose_drift": [1e3, 0.5, 0.0]}[law]
    joint = with_law(law_of(law), np.array(values))
    assert joint.shape.nominal_modes == len(shape.nominal.poles)
    pole = complex(shape.nominal.poles[0])
    half = -2 * pole.real + 0.02 * abs(pole)  # of the harmonic and of an added mode with a damping ratio of 1 %
    for off, places in ((0.9, at_harmonic), (1.1, [])):
        added = 2 * abs(pole) + off * half
        mode = joint.with_mode(
            added * complex(-0.01, 1.0), np.ones(1, complex), np.ones(1, complex), library()["missing_mode"]
        )
        assert harmonics_of_modes(mode) == places


@pytest.mark.parametrize(("off", "places"), [(0.9, [0]), (1.1, [])])
def test_a_mode_within_the_bandwidth_of_another_of_its_shape_is_a_copy(off: float, places: list[int]) -> None:
    shape = ModelShape(Rig().model, LabError())
    pole = complex(shape.nominal.poles[0])
    half = -pole.real + 0.01 * abs(pole)
    added = (abs(pole) + off * half) * complex(-0.01, 1.0)
    nominal = Hypothesis(shape, np.zeros(shape.size))
    mode = nominal.with_mode(added, np.ones(1, complex), np.ones(1, complex), library()["missing_mode"])
    assert copies_of_modes(mode) == places


@pytest.mark.parametrize(("turned", "places"), [(0.0, [0]), (0.3, [])])
def test_a_close_mode_of_another_shape_is_no_copy(turned: float, places: list[int]) -> None:
    labels = ("TCP:+X", "TCP:+Y")
    pole, vector = complex(-2.0, 60.0), np.array([[1.0, 0.5]], dtype=complex)
    shape = ModelShape(ModalModel(np.array([pole]), vector, 1e-3 * vector, labels, labels), LabError())
    other = vector[0] + turned * np.array([-0.5, 1.0])
    mode = Hypothesis(shape, np.zeros(shape.size)).with_mode(
        1.01 * pole, other, 1e-3 * other, library()["missing_mode"]
    )
    assert copies_of_modes(mode) == places


LAWS = ("coulomb_friction", "stiffness_hardening")


def _overdamped(evidence: float) -> Candidate:
    return Candidate("missing_mode", evidence, "impossible", {"impossible": "a mode damped by 55 % is no resonance"})


def test_an_impossible_linear_cause_that_explains_more_contradicts_the_accepted_ones() -> None:
    search = _search()  # evidence of 1100 in all
    assert impossible_rival(replace(search, rejected=(_overdamped(1099.0),)), LAWS) == ""
    sentence = impossible_rival(replace(search, rejected=(_overdamped(1101.0),)), LAWS)
    assert "missing_mode would explain more (evidence 1101) than coulomb_friction, missing_mode (1100)" in sentence
    assert "damped by 55 %" in sentence
    law = Candidate("stiffness_hardening", 5000.0, "impossible", {"impossible": "phases"})
    assert impossible_rival(replace(search, rejected=(law,)), LAWS) == ""
    nothing = replace(search, steps=search.steps[:1], accepted=())
    assert impossible_rival(replace(nothing, rejected=(_overdamped(1101.0),)), LAWS) == ""


def test_a_law_that_only_the_score_test_shows_forbids_the_verdict_none() -> None:
    search = replace(_search(), steps=_search().steps[:1], accepted=())
    for name, evidence, stage, contradicts in (
        ("stiffness_hardening", 101.0, "screened", True),
        ("stiffness_hardening", 99.0, "screened", False),
        ("missing_mode", 1000.0, "screened", False),
        ("stiffness_hardening", 1000.0, "fitted", False),
    ):
        tried = replace(search, rejected=(Candidate(name, evidence, stage),))
        assert bool(unproved_law(tried, LAWS, 100.0)) is contradicts
    assert unproved_law(replace(_search(), rejected=(Candidate(LAWS[0], 1e4, "screened"),)), LAWS, 100.0) == ""


def _fit(hypothesis: Hypothesis, score: float) -> Fit:
    return Fit(hypothesis, (), score, 0.0, score, np.zeros((hypothesis.size, hypothesis.size)))


def _search() -> Search[Fit]:
    """Friction first, then a mode beside it."""
    shape = ModelShape(Rig().model, LabError())
    base = Hypothesis(shape, np.zeros(shape.size))
    friction = with_law(law_of("coulomb_friction"), np.array([3.0, 2e-3]))
    mode = friction.with_mode(-3 + 90j, np.ones(1, complex), np.ones(1, complex), library()["missing_mode"])
    steps = _fit(base, 0.0), _fit(friction, -1000.0), _fit(mode, -1100.0)
    stated = [
        Proposal(name, {}, each, 0.0) for name, each in (("coulomb_friction", steps[1]), ("missing_mode", steps[2]))
    ]
    return Search(steps, tuple(stated))


def test_without_the_last_cause_the_step_before_never_runs_away() -> None:
    result = _search()
    lost = _fit(result.steps[1].hypothesis, np.inf)
    assert fit_without(_Comparison(lost), result, 1) is result.steps[1]
    better = _fit(result.steps[1].hypothesis, -1050.0)
    assert fit_without(_Comparison(better), result, 1) is better


def test_a_step_that_holds_another_cause_is_not_the_step_before() -> None:
    result = _search()
    lost = _fit(result.steps[1].hypothesis, np.inf)
    other = replace(result, steps=(result.steps[0], result.steps[0], result.steps[2]))
    assert fit_without(_Comparison(lost), other, 1) is lost
    assert fit_without(_Comparison(lost), result, 0) is lost


def test_nothing_stands_where_the_rest_runs_away_without_what_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two levels of a linear rig; the first cause is called idle, and the fit without it runs away."""
    lines = [
        windowed_spectrum(record, band_of(Rig().model, 128.0), 1.0) for record in Rig().recordings((1.0, 2.0), 40.0)
    ]
    result = _search()
    both = recordings_of(lines, lines, result.base.hypothesis)
    base = fit(lines, result.base.hypothesis, iterations=3)
    result = replace(result, steps=(base, *result.steps[1:]))
    worth = held_out_improvement(both, base.hypothesis, base.noises, (), Settings().proof)
    lost = _fit(result.steps[1].hypothesis, np.inf)
    monkeypatch.setattr(confirmation, "_unconfirmed_cause", lambda *given: (0, lost))
    comparison = StructureComparison(lines, {}, Settings(), remainder_of(base.hypothesis, lines))
    left = confirmation._confirmed(comparison, both, result, [], worth)
    assert left.search.accepted == ()
    assert left.search.current is base
    assert {rejected.name for rejected in left.search.rejected} == {"coulomb_friction", "missing_mode"}
    assert left.held_out.improvement.after == pytest.approx(worth.improvement.after)
