"""Coefficients within a laboratory's error, against their formulas."""

import math

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.mismatch import COEFFICIENT_NAMES
from millfrf.mismatch.cut.hypothesis import Belief

SLOT = MillingProcess(2, 0.01, math.pi / 2, 1e8, 0.3, 0.02, 0.0, math.pi, 1e-4, kte=2e4, kre=1e3, kae=0.0)


def test_one_deviation_is_one_standard_error_of_each() -> None:
    """ktc on a logarithmic scale; ratios by their size, 0.1 at least; edge forces by the chip's, ktc f = 1e4 N/m."""
    values, errors = Belief(SLOT, 0.1).named_numbers(np.ones(6), np.ones(6))
    assert tuple(values) == COEFFICIENT_NAMES
    expected = (1e8 * math.exp(0.1), 0.33, 0.03, 2.2e4, 2e3, 1e3)
    assert tuple(values.values()) == pytest.approx(expected)
    assert tuple(errors.values()) == pytest.approx((1e7 * math.exp(0.1), 0.03, 0.01, 2e3, 1e3, 1e3))


def test_edge_coefficients_do_not_become_negative() -> None:
    belief = Belief(SLOT, 0.1)
    lowest = belief.process_at(belief.lowest)
    assert (lowest.kte, lowest.kre, lowest.kae) == (0.0, 0.0, 0.0)
    assert belief.process_at(np.zeros(6)) == SLOT


@pytest.mark.parametrize("error", [0.0, 1.0, -0.2])
def test_an_error_that_is_no_share_is_refused(error: float) -> None:
    with pytest.raises(InputError, match="give a share between 0 and 1"):
        Belief(SLOT, error)
