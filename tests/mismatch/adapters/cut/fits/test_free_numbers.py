"""Order, units and bounds of a fit: a hypothesis goes to coordinates and back."""

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.fitting import FreeNumbers

TRUTH = stated(np.array([0.5, -1.0, 0.2, 0.0, 0.1, 0.3]), runout=[12e-6], process_damping=[2e5])


@pytest.mark.parametrize("refit", [True, False])
def test_the_first_point_is_the_hypothesis_to_begin_with(refit: bool) -> None:
    free = FreeNumbers(small_cut(TRUTH), TRUTH, ("runout", "process_damping"), refit)
    again = free.hypothesis(free.begin)
    np.testing.assert_allclose(again.deviations, TRUTH.deviations, rtol=1e-12)
    for name in ("runout", "process_damping", "regenerative_feedback"):
        np.testing.assert_allclose(again.values(name), TRUTH.values(name), rtol=1e-12)
    assert again.laws == TRUTH.laws
    assert (free.coefficients, free.physical, len(free.begin)) == ((6, 8, 11) if refit else (0, 2, 5))


def test_a_coordinate_of_the_spindle_moves_its_end_by_one_unit() -> None:
    """Angle, speed and its change each turn the spindle by 0.01 rad at the ends of the recording."""
    free = FreeNumbers(small_cut(TRUTH), TRUTH, (), False)
    end = np.array([3.25])
    for place in range(3):
        moved = free.hypothesis(np.eye(3)[place]).laws[0]
        turned = float((moved.angles(end) - TRUTH.laws[0].angles(end))[0])
        assert turned == pytest.approx(0.01, rel=1e-6)


def test_bounds_are_those_of_the_causes_and_of_edge_coefficients() -> None:
    free = FreeNumbers(small_cut(TRUTH), TRUTH, ("regenerative_feedback",), True)
    low, high = free.bounds
    at_bounds = free.hypothesis(np.where(np.isfinite(low), low, 0.0))
    assert at_bounds.values("regenerative_feedback").tolist() == [0.0]
    assert free.hypothesis(np.where(np.isfinite(high), high, 0.0)).values("regenerative_feedback").tolist() == [3.0]
    process = free.cut.belief.process_at(at_bounds.deviations)
    assert (process.kte, process.kre, process.kae) == (0.0, 0.0, 0.0)


def test_covariance_is_the_inverse_in_si_with_the_spindle_eliminated() -> None:
    free = FreeNumbers(small_cut(TRUTH), TRUTH, ("runout",), True)
    rng = np.random.default_rng(1)
    root = rng.standard_normal((40, len(free.begin)))
    matrix = root.T @ root
    kept, spindle = slice(0, 7), slice(7, None)
    schur = matrix[kept, kept] - matrix[kept, spindle] @ np.linalg.solve(
        matrix[spindle, spindle], matrix[spindle, kept]
    )
    units = np.array([1.0] * 6 + [1e-6])
    np.testing.assert_allclose(free.covariance(matrix), np.linalg.inv(schur) * np.outer(units, units), rtol=1e-9)
