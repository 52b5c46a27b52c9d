"""A channel's characteristic: shape, and limit and sharpness from noisy data with honest errors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.mismatch.joints.joint_law import Saturation, rounded, saturated

SIGNALS = st.floats(-1e6, 1e6)


@given(SIGNALS, st.floats(1e-3, 1e3), st.floats(1.0, 80.0))
def test_odd_bounded_and_sharp_in_the_end(signal: float, limit: float, sharpness: float) -> None:
    x = np.array([signal, -signal])
    shown = saturated(x, limit, sharpness)
    assert shown[0] == -shown[1]
    assert abs(shown[0]) <= min(abs(signal), limit) * (1 + 1e-12)
    assert abs(saturated(x, limit, 1e6)[0] - saturated(x, limit)[0]) <= 1e-5 * limit


def test_intervals_of_limit_and_sharpness_hold_the_truth() -> None:
    limit, sharpness, inside = 2.0, 9.0, np.zeros(2)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        due = rng.normal(size=6000) * 1.5
        measured = saturated(due, limit, sharpness) + 0.03 * rng.normal(size=6000)
        result = rounded(measured, due, Saturation(1.98, 0.01))
        inside += [
            abs(result.limit - limit) < 1.96 * result.error,
            abs(result.sharpness - sharpness) < 1.96 * result.sharpness_error,
        ]
    assert (inside > 0.85 * 60).all(), inside


def test_a_sharp_limit_stays_sharp() -> None:
    rng = np.random.default_rng(4)
    due = rng.normal(size=6000) * 1.5
    sharp = Saturation(2.0, 0.01)
    assert rounded(saturated(due, 2.0) + 0.03 * rng.normal(size=6000), due, sharp) == sharp


def test_far_beyond_the_limit_nothing_overflows() -> None:
    assert saturated(np.array([1e300]), 2.0, 50.0) == pytest.approx(2.0)
