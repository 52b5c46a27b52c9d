"""Fourier coefficients of the milling force against closed forms and a direct sum."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, force_harmonics, tooth_force


def process(start: float, width: float, **changes: float) -> MillingProcess:
    values = {"krc": 0.3, "kac": 0.2, "feed_per_tooth": 1e-4, **changes}
    return MillingProcess(2, 0.01, math.pi / 2, 1e8, start_angle=start, exit_angle=start + width, **values)


@given(start=st.floats(0, 2.5), width=st.floats(0.1, 0.6), harmonic=st.integers(0, 5))
def test_equals_the_sum_over_a_turn(start: float, width: float, harmonic: int) -> None:
    cut = process(start, width, kte=2e3, kre=1e3, kae=5e2)
    n = 200_000
    angles = (np.arange(n) + 0.5) * 2 * math.pi / n
    inside = (angles >= cut.start_angle) & (angles <= cut.exit_angle)
    chip = cut.feed_per_tooth * np.sin(angles[inside]) * cut.ktc
    force = np.array(
        [
            tooth_force(math.sin(a), math.cos(a), 1.0, 0.0, t + 2e3, 0.3 * t + 1e3, 0.2 * t + 5e2)
            for a, t in zip(angles[inside][::50], chip[::50], strict=True)
        ]
    )
    waves = np.exp(-2j * harmonic * angles[inside][::50])
    expected = 2 * (waves @ force) * 50 / n
    result = force_harmonics(cut, harmonic)[harmonic]
    np.testing.assert_allclose(result, expected, atol=3e-3 * np.abs(force).max())


def test_full_immersion_of_four_teeth_is_constant() -> None:
    """A slot with four teeth: every harmonic of the tooth-passing frequency cancels in X and Y."""
    slot = MillingProcess(4, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4)
    coefficients = force_harmonics(slot, 3)
    assert np.abs(coefficients[1:]).max() < 1e-9 * np.abs(coefficients[0]).max()


def test_negative_number_is_refused() -> None:
    with pytest.raises(InputError, match="harmonics"):
        force_harmonics(process(0.0, 1.0), -1)
