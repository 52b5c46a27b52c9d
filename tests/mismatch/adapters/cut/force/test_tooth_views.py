"""Where teeth stand, against the geometry of a cut."""

import math

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.mismatch.cut.hypothesis import fineness, view_of
from millfrf.mismatch.cut.motion import SpindleLaw, TipMotion
from millfrf.mismatch.cut.recordings import CutRecording

PROCESS = MillingProcess(3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4)
RATE, LAW = 5000.0, SpindleLaw(0.5, 0.2, 90.0)
TIMES = np.arange(5000) / RATE


def _recording(motion: TipMotion | None = None) -> CutRecording:
    return CutRecording("r", RATE, np.zeros((5000, 3)), (0, 1, 2), motion, LAW, 0.1)


def test_the_shares_of_a_tooth_add_up_to_the_time_that_it_cuts() -> None:
    view = view_of(_recording(), PROCESS, LAW, 2)
    assert (view.count, view.fine, view.earlier) == (10000, 2, 4)
    expected = (PROCESS.exit_angle - PROCESS.start_angle) / (2 * math.pi) * view.count
    for tooth in view.teeth:
        assert tooth.share.sum() == pytest.approx(expected, rel=0.03)
        assert tooth.cutting_speed == pytest.approx(90.0 * 0.006)
        assert np.arctan2(tooth.sine, tooth.cosine).min() >= PROCESS.start_angle
        assert np.arctan2(tooth.sine, tooth.cosine).max() <= PROCESS.exit_angle
        np.testing.assert_allclose(np.linalg.norm(tooth.normal, axis=1), 1.0, rtol=1e-12)


def test_earlier_displacement_is_that_of_the_passing_before() -> None:
    """A steady drift along X: one tooth period ago the tip stood so much further back."""
    drift = np.stack([1e-3 * TIMES, 0 * TIMES, 0 * TIMES], axis=1)
    speed = np.tile([1e-3, 0.0, 0.0], (5000, 1))
    tooth = view_of(_recording(TipMotion(drift, speed, "measured")), PROCESS, LAW, 1).teeth[1]
    late = TIMES[tooth.index] > 0.2
    period = 2 * math.pi / 3 / LAW.speed
    for k in (1, 3):
        moved = (tooth.outward[0] - tooth.outward[k])[late]
        np.testing.assert_allclose(moved, (1e-3 * k * period * tooth.normal[:, 0])[late], rtol=1e-9)
    np.testing.assert_allclose(tooth.velocity, 1e-3 * tooth.normal[:, 0], rtol=1e-12)


def test_instants_resolve_thirty_two_to_a_period() -> None:
    for top in (100.0, 300.0, 1000.0):
        assert fineness(_recording(), top) * RATE >= 31 * top or fineness(_recording(), top) == 1
