"""Lines of forces that sweep evenly: found with their course, and nowhere else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from estimation import swept_line

RATE, SECONDS = 256.0, 24.0
TIME = np.arange(int(RATE * SECONDS)) / RATE


def _teeth(start: float, end: float, seed: int, noise: float = 0.5) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    phase = 2 * np.pi * (start * TIME + (end - start) * TIME**2 / (2 * SECONDS))
    harmonics = [size * np.sin(k * phase + rng.uniform(0, 6)) for k, size in ((1, 1.0), (2, 0.3), (3, 0.1))]
    return np.column_stack([sum(harmonics) + noise * rng.normal(size=len(TIME)) + offset for offset in (0.0, 40.0)])


@settings(max_examples=25, deadline=None)
@given(st.floats(5.0, 15.0), st.floats(22.0, 40.0), st.booleans(), st.integers(0, 1000))
def test_the_course_is_found_up_and_down(low: float, high: float, down: bool, seed: int) -> None:
    ends = (high, low) if down else (low, high)
    assert swept_line(_teeth(*ends, seed), RATE) == pytest.approx(ends, abs=0.05)


def test_noise_has_no_line_that_sweeps() -> None:
    rng = np.random.default_rng(3)
    coloured = np.cumsum(rng.normal(size=(200, len(TIME))), axis=1)
    assert all(swept_line(each[:, None], RATE) is None for each in rng.normal(size=(200, len(TIME))))
    assert all(swept_line(each[:, None], RATE) is None for each in coloured)


def test_a_constant_speed_does_not_sweep() -> None:
    assert swept_line(_teeth(20.0, 20.0, 1), RATE) is None
    assert swept_line(_teeth(20.0, 21.0, 1), RATE) is None  # less than four lines of a window


def test_blows_and_records_that_are_too_short_have_no_line() -> None:
    blows = np.zeros((len(TIME), 1))
    blows[:: int(4 * RATE)] = 100.0
    assert swept_line(blows, RATE) is None
    assert swept_line(np.zeros((20, 1)), RATE) is None
    assert swept_line(np.zeros((len(TIME), 1)), RATE) is None
