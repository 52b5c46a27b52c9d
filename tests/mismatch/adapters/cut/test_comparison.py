"""The search over a cut that is computed: what acts is found, what does not is left."""

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.comparison import UNCONFIRMED, CutComparison, covariance_with_usual_error
from millfrf.mismatch.cut.fitting import fit_with_tooth_numbers
from millfrf.mismatch.cut.settings import CUT
from millfrf.mismatch.inference.search import Search, search

NAMES = ("process_damping", "regenerative_feedback", "runout")


def _silent(stage: str) -> None:
    del stage


def test_the_causes_that_act_are_found_in_the_order_of_their_evidence() -> None:
    cut = small_cut(stated(runout=[12e-6], regenerative_feedback=[1.0]))
    base = fit_with_tooth_numbers(cut, stated(), ())
    result = search(CutComparison(cut, NAMES, CUT), base, _silent)
    assert {each.name for each in result.accepted} == {"runout", "regenerative_feedback"}
    for before, after, each in zip(result.steps, result.steps[1:], result.accepted, strict=False):
        assert each.evidence == pytest.approx(before.score - after.score)
    last = result.rounds[-1]
    assert last.chosen is None
    assert [each.name for each in last.proposals] == ["process_damping"]
    assert last.candidates[0].stage == "fitted"


def test_nothing_is_added_where_nothing_acts() -> None:
    cut = small_cut(stated(), seed=4)
    result = search(CutComparison(cut, NAMES, CUT), fit_with_tooth_numbers(cut, stated(), ()), _silent)
    assert result.accepted == ()
    assert all(candidate.evidence < CUT.evidence.least for candidate in result.candidates)


def test_a_search_ends_when_every_cause_is_in() -> None:
    cut = small_cut(stated(runout=[12e-6]))
    comparison = CutComparison(cut, ("runout",), CUT)
    base = fit_with_tooth_numbers(cut, stated(), ())
    assert not comparison.finished(Search((base,)))
    assert comparison.finished(Search((base, fit_with_tooth_numbers(cut, stated(), ("runout",)))))


@pytest.mark.long
def test_without_a_cause_the_fit_is_that_of_the_others() -> None:
    cut = small_cut(stated(runout=[12e-6], regenerative_feedback=[1.0]))
    comparison = CutComparison(cut, NAMES, CUT)
    result = search(comparison, fit_with_tooth_numbers(cut, stated(), ()), _silent)
    place = [cause.name for cause in result.accepted].index("runout")
    less = comparison.without(result, place)
    assert less.freed == ("regenerative_feedback",)
    assert less.hypothesis.values("runout").tolist() == [0.0]
    assert less.score == pytest.approx(fit_with_tooth_numbers(cut, stated(), ("regenerative_feedback",)).score, abs=0.5)


def test_a_number_within_its_usual_error_is_not_confirmed() -> None:
    """Runout that is smaller than four of its errors is not told, whatever its evidence."""
    cut = small_cut(stated(runout=[12e-6]), error=0.3)
    round_ = CutComparison(cut, ("runout",), CUT).round(Search((fit_with_tooth_numbers(cut, stated(), ()),)))
    assert round_.chosen is None
    assert round_.candidates[0].evidence > CUT.evidence.least
    assert round_.candidates[0].stage == UNCONFIRMED


def test_the_usual_error_adds_to_the_variance() -> None:
    cut = small_cut(stated(runout=[12e-6]), error=0.01)
    fit = fit_with_tooth_numbers(cut, stated(), ("runout",))
    extra = covariance_with_usual_error(cut, fit, "runout") - fit.covariance_of("runout")
    np.testing.assert_allclose(extra, [[(0.01 * fit.hypothesis.values("runout")[0]) ** 2]], rtol=1e-6)
