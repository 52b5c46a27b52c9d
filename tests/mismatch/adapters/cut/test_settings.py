"""Every threshold of a cut is stated once, and reaches the decision."""

from dataclasses import fields

import numpy as np

from millfrf.mismatch.cut.physics import cut_library
from millfrf.mismatch.cut.settings import CUT, CutSettings
from millfrf.mismatch.inference.diagnosis import Findings, Remainder, verdict_of
from millfrf.mismatch.inference.numerics import students_test


def test_the_thresholds_are_those_of_the_documentation() -> None:
    assert (CUT.evidence.least, CUT.evidence.as_good, CUT.evidence.clear) == (20.0, 6.0, 4.0)
    assert (CUT.proof.gain, CUT.proof.significance) == (10.0, 0.01)
    assert CUT.proof.test is students_test
    assert CUT.search.most_causes >= len(cut_library())
    own = {each.name for each in fields(CutSettings)} - {each.name for each in fields(CutSettings.__mro__[1])}
    assert {name: getattr(CUT, name) for name in own} == {
        "coefficient_error": 0.15,
        "force_error": 0.01,
        "implausible": 3.0,
        "chance": 1e-7,
        "usual_errors": 3.0,
    }


def test_verdicts_over_what_is_left() -> None:
    """Before: a share of 0.5 and a power of 1. Explained needs noise; partly needs half of the power gone."""
    before = Remainder(0.5, 1.0)
    for share, size, expected in (
        (0.08, 0.9, "explained"),
        (0.09, 0.01, "partly explained"),
        (0.4, 0.5, "partly explained"),
        (0.4, 0.51, "unexplained"),
    ):
        assert verdict_of(Findings(before, Remainder(share, size), True), CUT.verdict) == expected
    for share, expected in ((0.08, "none"), (0.081, "unexplained")):
        left = Remainder(share, 1.0)
        assert verdict_of(Findings(left, left, False), CUT.verdict) == expected
    chatters = Findings(before, Remainder(0.0, 0.0), True, excluded=True)
    assert verdict_of(chatters, CUT.verdict) == "unexplained"


def test_few_blocks_can_be_significant() -> None:
    """The reason for Student's test: the least p-value of ranks over six blocks is 1/64; four may be all."""
    fall = np.arange(6.0) + 10
    assert CUT.proof.test(fall, np.zeros(6)) < CUT.proof.significance < 1 / 64
