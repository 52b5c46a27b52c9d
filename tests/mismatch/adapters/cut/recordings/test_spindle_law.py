"""The spindle's law: found from forces, and its delay."""

import math

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.mismatch.cut.motion import SpindleLaw, found_law


def test_the_speed_is_found_from_the_forces_through_noise_and_sweep() -> None:
    rng = np.random.default_rng(5)
    times = np.arange(40000) / 4000.0
    for change in (0.0, 1.5):
        law = SpindleLaw(float(times[-1]) / 2, 1.0, 84.0, change)
        angles = law.angles(times)
        force = np.stack([np.cos(2 * angles) + 0.4 * np.cos(4 * angles), np.sin(2 * angles)], axis=1)
        noisy = force + 0.5 * rng.standard_normal(force.shape)
        stated = SpindleLaw(0.0, 0.0, 0.99 * float(law.speeds(np.zeros(1))[0]), change)
        result = found_law(noisy, 4000.0, stated, 2)
        assert result.speed == pytest.approx(law.speed, abs=0.05)
        assert result.change == pytest.approx(change, abs=0.02)
    with pytest.raises(InputError, match="no tooth passing within 2 % of 802"):
        found_law(rng.standard_normal((40000, 2)), 4000.0, SpindleLaw(0.0, 0.0, 84.0), 2)


def test_the_delay_of_a_sweep_turns_the_spindle_by_one_pitch() -> None:
    law, times = SpindleLaw(2.0, 0.3, 80.0, -4.0), np.linspace(0.5, 4.0, 9)
    lag = law.lag(times, math.pi)
    np.testing.assert_allclose(law.angles(times) - law.angles(times - lag), math.pi, rtol=1e-12)
