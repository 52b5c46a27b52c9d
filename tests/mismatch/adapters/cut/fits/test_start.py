"""Where fits begin: the spindle's angle, and the numbering of teeth in further recordings."""

import math

import numpy as np
import pytest
from small_cut import PROCESS, small_cut, stated

from millfrf.mismatch.cut.fitting import fit_with_tooth_numbers, started


@pytest.mark.parametrize("angle", [0.1, 1.3, 2.9])
def test_the_angle_is_found_to_half_a_step_within_a_pitch(angle: float) -> None:
    truth = stated(np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0])).with_angle(0, angle)
    result = started(small_cut(truth), truth.acting).laws[0].angle
    pitch = 2 * math.pi / PROCESS.teeth
    off = (result - angle + pitch / 2) % pitch - pitch / 2
    assert abs(off) <= 0.5 * pitch / 40 + 1e-9


def test_teeth_of_a_further_recording_are_numbered_as_in_the_first() -> None:
    """The second recording begins half a turn later: by itself it would tell a runout of the other sign."""
    truth = stated(laws=2, runout=[12e-6]).with_angle(1, 0.4 + math.pi)
    cut = small_cut(truth)
    fit = fit_with_tooth_numbers(cut, stated(laws=2), ("runout",))
    assert abs(fit.hypothesis.values("runout")[0]) == pytest.approx(12e-6, rel=0.02)
    turned = fit.hypothesis.laws[1].angle - fit.hypothesis.laws[0].angle
    assert abs(turned) == pytest.approx(math.pi, abs=0.01)
