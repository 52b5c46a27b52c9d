"""What is left, on a constant in white noise, whose shares and sizes are known in closed form."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.mismatch.inference.diagnosis import Findings, Remainder, verdict_of
from millfrf.mismatch.inference.settings import VerdictSettings

POWER = st.floats(1e-6, 1e6)


def left_of(power: float, noise: float) -> Remainder:
    """Power beyond noise: as a share of the residual's, and by itself."""
    return Remainder(power / (power + noise), power)


@given(POWER, POWER, st.floats(0.01, 0.9))
def test_a_residual_passes_for_noise_up_to_a_known_ratio(power: float, noise: float, most: float) -> None:
    """``a / (a + n) <= m`` is ``a <= n m / (1 - m)``."""
    limit = noise * most / (1 - most)
    if abs(power - limit) > 1e-9 * limit:
        assert left_of(power, noise).noise_like(most) is (power < limit)


@given(POWER, POWER, POWER)
def test_what_has_gone_is_read_from_sizes_whatever_the_noise(before: float, after: float, noise: float) -> None:
    """Shares of two residuals have different wholes; the ratio of sizes is that of the powers."""
    first, other = left_of(before, noise), left_of(after, noise)
    assert other.size / first.size == pytest.approx(after / before)
    assert (other.size < first.size) is (other.share < first.share) or math.isclose(other.share, first.share)


def test_the_limit_itself_passes_and_what_is_unknown_does_not() -> None:
    assert Remainder(0.05, 1.0).noise_like(0.05)
    assert not Remainder(math.nextafter(0.05, 1), 1.0).noise_like(0.05)
    assert not Remainder(math.nan, 0.0).noise_like(0.05)
    assert not Remainder(math.inf, math.inf).noise_like(1e300)


def test_size_has_no_say_in_whether_it_is_noise() -> None:
    assert Remainder(0.01, 1e12).noise_like(0.05)
    assert not Remainder(0.5, 1e-12).noise_like(0.05)


@pytest.mark.parametrize(("offset", "verdict"), [(0.0, "none"), (0.1, "none"), (0.5, "unexplained")])
def test_an_offset_in_white_noise_is_measured_and_judged(offset: float, verdict: str) -> None:
    """A constant b in noise of variance 1 leaves ``b^2 / (1 + b^2)``: 1 % for 0.1, and 20 % for 0.5."""
    count = 40_000
    noise = np.random.default_rng(5).standard_normal(count)
    power = float(np.mean((noise + offset) ** 2))
    left = Remainder((power - 1) / power, power - 1)
    # mean squares of white noise scatter by sqrt(2 / n), and the offset by 2 b / sqrt(n) more
    error = math.sqrt((2 + 4 * offset**2) / count)
    assert left.size == pytest.approx(offset**2, abs=4 * error)
    assert left.share == pytest.approx(offset**2 / (1 + offset**2), abs=4 * error)
    assert verdict_of(Findings(left, left, named=False), VerdictSettings()) == verdict
