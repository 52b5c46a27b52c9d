"""What is named carries the numbers of the truth, and errors whose parts add as squares."""

import numpy as np
import pytest
from small_cut import PROCESS, small_cut, stated

from millfrf.mismatch import COEFFICIENTS
from millfrf.mismatch.cut.comparison import (
    UNCONFIRMED,
    CutComparison,
    accepted_causes,
    fit_halves,
    implausible_coefficients,
    last_candidates,
)
from millfrf.mismatch.cut.fitting import fit_cut, fit_with_tooth_numbers
from millfrf.mismatch.cut.settings import CUT
from millfrf.mismatch.inference.search import search


@pytest.mark.long
def test_accepted_causes_hold_the_truth_within_errors_whose_parts_add_as_squares() -> None:
    cut = small_cut(stated(runout=[12e-6], regenerative_feedback=[1.0]), noise=2.0, error=0.005)
    base = fit_with_tooth_numbers(cut, stated(), ())
    result = search(CutComparison(cut, ("runout", "regenerative_feedback"), CUT), base, lambda stage: None)
    final = result.current
    causes = accepted_causes(cut, result, fit_halves(cut, final.hypothesis, final.freed))
    assert [cause.name for cause in causes] == [each.name for each in result.accepted]
    truth = {"radial_offset_m": 12e-6, "share": 1.0}
    for cause in causes:
        for name, value in cause.parameters.items():
            assert abs(value - truth[name]) < 4 * cause.standard_errors[name]
            parts = cause.error_parts[name]
            assert set(parts) == {"fit", "spread", "form"}
            assert np.sqrt(sum(part**2 for part in parts.values())) == pytest.approx(cause.standard_errors[name])


def test_coefficients_are_named_from_three_laboratory_errors_on() -> None:
    for off, named in ((2.5, False), (3.5, True)):
        cut = small_cut(stated(np.array([off, 0.0, 0.0, 0.0, 0.0, 0.0])), noise=0.1)
        coefficients = implausible_coefficients(cut, fit_cut(cut, stated()), CUT)
        assert bool(coefficients) == named
        for cause in coefficients:
            assert cause.name == COEFFICIENTS
            assert cause.location == {"coefficients": ["ktc_pa"]}
            assert cause.parameters["ktc_pa"] == pytest.approx(PROCESS.ktc * np.exp(0.15 * off), rel=1e-3)


@pytest.mark.long
def test_candidates_are_told_as_they_were_last_weighed() -> None:
    cut = small_cut(stated(runout=[12e-6], regenerative_feedback=[1.0]))
    names = ("process_damping", "runout", "regenerative_feedback")
    base = fit_with_tooth_numbers(cut, stated(), ())
    result = search(CutComparison(cut, names, CUT), base, lambda stage: None)
    candidates = {candidate.name: candidate for candidate in last_candidates(result, result.current)}
    assert set(candidates) == set(names)
    for candidate in result.accepted:
        assert (candidates[candidate.name].evidence, candidates[candidate.name].stage) == (candidate.evidence, "fitted")
    assert candidates["process_damping"].evidence == result.rounds[-1].proposals[0].evidence
    unproven = {candidate.name: candidate.stage for candidate in last_candidates(result, base)}
    assert unproven["runout"] == unproven["regenerative_feedback"] == UNCONFIRMED
