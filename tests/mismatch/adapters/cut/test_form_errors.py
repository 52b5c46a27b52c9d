"""Errors that hold a cause's form, against their formulas."""

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.comparison import fit_halves, form_errors
from millfrf.mismatch.cut.fitting import fit_cut
from millfrf.mismatch.inference.search import Proposal

FREED = ("regenerative_feedback",)


def test_spread_and_form_are_those_of_the_single_fits() -> None:
    cut = small_cut(stated(regenerative_feedback=[1.0], process_damping=[4e4]), noise=2.0)
    final = fit_cut(cut, stated(), FREED)
    halves = fit_halves(cut, final.hypothesis, FREED)
    beside = fit_cut(cut, final.hypothesis, (*FREED, "process_damping"))
    elsewhere = fit_cut(cut, final.hypothesis, ("runout", *FREED))
    proposals = [Proposal("a", {}, beside, 0.0), Proposal("b", {}, elsewhere, 0.0)]
    result = form_errors(cut, final, halves, proposals)["regenerative_feedback"]

    def share(fit: object) -> float:
        return float(fit.hypothesis.values("regenerative_feedback")[0])  # type: ignore[attr-defined]

    pair = [share(half) for half in halves]
    bands = [share(fit_cut(cut.without_band(k / 4, (k + 1) / 4), final.hypothesis, FREED)) for k in range(4)]
    expected = (pair[0] - pair[1]) ** 2 / 4 + 0.75 * np.sum((np.array(bands) - np.mean(bands)) ** 2)
    assert result.spread[0] == pytest.approx(expected, rel=1e-9)
    weight = 1 - np.exp(-(final.cost - beside.cost) / 2)
    assert result.form[0] == pytest.approx((weight * (share(beside) - share(final))) ** 2, rel=1e-9)


def test_without_a_further_cause_the_form_adds_nothing() -> None:
    cut = small_cut(stated(regenerative_feedback=[1.0]))
    final = fit_cut(cut, stated(), FREED)
    result = form_errors(cut, final, fit_halves(cut, final.hypothesis, FREED), [])
    assert result["regenerative_feedback"].form.tolist() == [0.0]
