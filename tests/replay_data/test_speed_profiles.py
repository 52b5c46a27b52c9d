"""Spindle angle and speed belong together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import InputError
from replay_data import ConstantSpeed, LinearSweep, SpeedProfile
from replay_data.speed_profiles import DriftingSpeed

speeds = st.floats(5, 500)
profiles = st.one_of(
    st.builds(ConstantSpeed, speeds),
    st.builds(LinearSweep, speeds, speeds, st.floats(0.5, 60)),
    st.builds(DriftingSpeed, speeds, st.floats(0, 0.2), st.floats(1, 60)),
)


@given(profiles, st.floats(0, 100))
def test_the_spindle_turns_at_a_speed_between_slowest_and_fastest(profile: SpeedProfile, time: float) -> None:
    before, after = profile.angle(np.array([time, time + 1e-3]))
    speed = (after - before) / 1e-3
    assert profile.slowest * (1 - 1e-6) <= speed <= profile.fastest * (1 + 1e-6)


@given(profiles, st.floats(0.01, 1))
def test_a_rehearsal_runs_through_the_same_speeds(profile: SpeedProfile, share: float) -> None:
    rehearsed = profile.rehearsed(share)
    assert (rehearsed.slowest, rehearsed.fastest) == (profile.slowest, profile.fastest)
    assert profile.angle(np.zeros(1))[0] == 0


def test_the_sweep_of_the_paper_passes_15_to_23_hz() -> None:
    """450 to 690 rpm in 60 s with two teeth (Mohammadi & Ahmadi)."""
    sweep = LinearSweep(450 * np.pi / 30, 690 * np.pi / 30, 60.0)
    first, last = (2 * np.diff(sweep.angle(np.array([t, t + 1e-4])))[0] / (2e-4 * np.pi) for t in (0.0, 59.9999))
    assert (first, last) == (pytest.approx(15.0, rel=1e-4), pytest.approx(23.0, rel=1e-4))


def test_standstill_is_refused() -> None:
    with pytest.raises(InputError, match=r"spindle speed = 0.0 rad/s must be positive"):
        ConstantSpeed(0.0)
    with pytest.raises(InputError, match=r"0 <= share < 1"):
        DriftingSpeed(100.0, 1.0, 10.0)
