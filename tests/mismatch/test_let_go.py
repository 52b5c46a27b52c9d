"""Causes that are let go of: modes without damping, and those without which the others run away."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hidden_joint import law_of, with_law
from one_mode_rig import Rig

from estimation import windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, fit, library
from millfrf.mismatch.inference.search import Proposal, Search
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure import held_out as confirmation
from millfrf.mismatch.structure.comparison import StructureComparison
from millfrf.mismatch.structure.held_out import fit_without, held_out_improvement, recordings_of
from millfrf.mismatch.structure.reported_causes import undamped_modes
from millfrf.mismatch.structure.structured_residual import remainder_of


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


def _fit(hypothesis: Hypothesis, score: float) -> Fit:
    return Fit(hypothesis, (), score, 0.0, score, np.zeros((hypothesis.size, hypothesis.size)))


def _search() -> Search[Fit]:
    """Friction first, then a mode beside it."""
    shape = ModelShape(Rig().model, LabError())
    base = Hypothesis(shape, np.zeros(shape.size))
    friction = with_law(law_of("coulomb_friction"), np.array([3.0, 2e-3]))
    mode = friction.with_mode(-3 + 90j, np.ones(1, complex), np.ones(1, complex), library()["missing_mode"])
    steps = _fit(base, 0.0), _fit(friction, -1000.0), _fit(mode, -1100.0)
    told = [Proposal(name, {}, one, 0.0) for name, one in (("coulomb_friction", steps[1]), ("missing_mode", steps[2]))]
    return Search(steps, tuple(told))


def test_without_the_last_cause_the_step_before_never_runs_away() -> None:
    found = _search()
    lost = _fit(found.steps[1].hypothesis, np.inf)
    assert fit_without(_Comparison(lost), found, 1) is found.steps[1]
    better = _fit(found.steps[1].hypothesis, -1050.0)
    assert fit_without(_Comparison(better), found, 1) is better


def test_a_step_that_holds_another_cause_is_not_the_step_before() -> None:
    found = _search()
    lost = _fit(found.steps[1].hypothesis, np.inf)
    other = replace(found, steps=(found.steps[0], found.steps[0], found.steps[2]))
    assert fit_without(_Comparison(lost), other, 1) is lost
    assert fit_without(_Comparison(lost), found, 0) is lost


def test_nothing_stands_where_the_rest_runs_away_without_what_is_not_confirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two levels of a linear rig; the first cause is called idle, and the fit without it runs away."""
    lines = [
        windowed_spectrum(record, band_of(Rig().model, 128.0), 1.0) for record in Rig().recordings((1.0, 2.0), 40.0)
    ]
    found = _search()
    both = recordings_of(lines, lines, found.base.hypothesis)
    base = fit(lines, found.base.hypothesis, iterations=3)
    found = replace(found, steps=(base, *found.steps[1:]))
    worth = held_out_improvement(both, base.hypothesis, base.noises, (), Settings().proof)
    lost = _fit(found.steps[1].hypothesis, np.inf)
    monkeypatch.setattr(confirmation, "_unconfirmed_cause", lambda *given: (0, lost))
    comparison = StructureComparison(lines, {}, Settings(), remainder_of(base.hypothesis, lines))
    left = confirmation._confirmed(comparison, both, found, [], worth)
    assert left.search.accepted == ()
    assert left.search.current is base
    assert {rejected.name for rejected in left.search.rejected} == {"coulomb_friction", "missing_mode"}
    assert left.held_out.improvement.after == pytest.approx(worth.improvement.after)
