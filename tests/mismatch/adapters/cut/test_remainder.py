"""What is left against noise of known law, and against an order that is put in."""

from dataclasses import replace

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.comparison import cut_remainder
from millfrf.mismatch.cut.settings import CUT

TRUTH = stated(runout=[12e-6])


def test_the_truth_leaves_nothing_but_noise() -> None:
    result = cut_remainder(small_cut(TRUTH, seed=2), TRUTH, CUT)
    assert (result.left.size, result.left.share, result.orders, result.channels) == (0.0, 0.0, (), ())


def test_a_line_is_told_with_its_power_order_and_channel() -> None:
    cut = small_cut(TRUTH)
    spectra = cut.spectra[0]
    orders = spectra.frequencies / (spectra.recording.law.speed / (2 * np.pi))
    line = int(np.argmin(np.abs(orders - 5.5)))
    measured = spectra.measured.copy()
    predicted = cut.predicted(0, TRUTH)
    measured[:, line, 1] = predicted[:, line, 1] + 30.0
    result = cut_remainder(replace(cut, spectra=(replace(spectra, measured=measured),)), TRUTH, CUT)
    rest = float(np.sum(np.abs(measured - predicted) ** 2))
    assert result.left.size == pytest.approx(spectra.blocks * 900.0)
    assert result.left.share == pytest.approx(spectra.blocks * 900.0 / rest)
    assert result.channels == ("TCP:+Y",)
    assert result.orders == (round(float(orders[line]), 1),)


def test_what_a_right_force_is_usually_off_is_not_left() -> None:
    """Three times one per cent of each line passes, ten times does not."""
    for times, left in ((2.0, False), (10.0, True)):
        cut = small_cut(TRUTH, noise=0.01, error=0.01)
        spectra = cut.spectra[0]
        off = replace(spectra, measured=spectra.measured * (1 + 0.01 * times))
        assert (cut_remainder(replace(cut, spectra=(off,)), TRUTH, CUT).left.size > 0) == left
