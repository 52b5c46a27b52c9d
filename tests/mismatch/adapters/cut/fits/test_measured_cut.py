"""What stays the same while hypotheses are compared, against the truth of a cut that is computed."""

from dataclasses import replace

import numpy as np
import pytest
from small_cut import small_cut, stated

TRUTH = stated(runout=[12e-6], regenerative_feedback=[1.0])


def test_the_whitened_residual_of_the_truth_is_white_and_of_unit_power() -> None:
    """``2 |W r|^2`` is chi-square of two degrees of freedom: mean 2, variance 4."""
    cut = small_cut(TRUTH, seed=3)
    power = 2 * np.abs(cut.residual(0, TRUTH)) ** 2
    count = power.size
    # the floor is a median over lines: it is known to a few per cent
    assert power.mean() == pytest.approx(2.0, rel=0.05)
    assert power.var() == pytest.approx(4.0, rel=0.05 + 10 / np.sqrt(count))


def test_before_the_noise_is_known_the_residual_is_in_newtons() -> None:
    cut = small_cut(TRUTH, noise=0.0)
    plain = replace(cut, noise=())
    np.testing.assert_array_equal(plain.residual(0, TRUTH), 0.0)
    assert np.abs(plain.predicted(0, TRUTH)).max() > 1.0


def test_bands_left_out_share_the_lines_among_them() -> None:
    cut = small_cut(TRUTH)
    whole = np.abs(cut.residual(0, TRUTH)) ** 2
    kept = [np.abs(cut.without_band(k / 4, (k + 1) / 4).residual(0, TRUTH)) ** 2 for k in range(4)]
    np.testing.assert_allclose(np.sum(kept, axis=0), 3 * whole, rtol=1e-12)


def test_one_of_two_recordings_alone() -> None:
    truth = stated(laws=2)
    cut = small_cut(truth.with_angle(1, 2.0))
    alone = cut.only(1)
    assert [each.recording.name for each in alone.spectra] == ["cut1"]
    shown = alone.predicted(0, stated().with_angle(0, 2.0))
    np.testing.assert_array_equal(shown, cut.predicted(1, truth.with_angle(1, 2.0)))


def test_noise_of_the_motion_is_added_once_more() -> None:
    cut = small_cut(TRUTH)
    motion = cut.spectra[0].recording.motion
    assert motion is not None
    noise = np.full((2, *motion.displacement.shape), 1e-6)
    recording = replace(cut.spectra[0].recording, motion=replace(motion, noise=noise))
    noisier = replace(cut, spectra=(replace(cut.spectra[0], recording=recording),)).noisier()
    moved = noisier.spectra[0].recording.motion
    assert moved is not None
    np.testing.assert_allclose(moved.displacement - motion.displacement, 1e-6, atol=1e-18)
