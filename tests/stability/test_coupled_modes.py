"""Mode coupling against regeneration: cases whose answer is known beforehand."""

import numpy as np
import pytest

from millfrf.core import TIP
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, judge_mode_coupling, mode_coupling_limit, with_static_high_modes
from modal_fit import ModalModel

CUT = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, 0.0, np.pi, 1e-4)
SPEED = 6000 * np.pi / 30


def structure(frequencies: list[float], directions: list[float], ratio: float = 0.04, mass: float = 40.0) -> ModalModel:
    """Real modes that move in X and Y at the given angles, rad."""
    natural = 2 * np.pi * np.array(frequencies)
    damped = natural * np.sqrt(1 - ratio**2)
    shapes = np.column_stack([np.cos(directions), np.sin(directions), np.zeros(len(directions))]) / np.sqrt(mass)
    left = shapes / (2j * damped[:, None])
    return ModalModel(-ratio * natural + 1j * damped, shapes.astype(complex), left, TIP, TIP)


def test_one_mode_cannot_couple() -> None:
    found = judge_mode_coupling(structure([20.0], [0.6]), CUT, SPEED / 10, 0.05)
    assert found.alone == found.limit
    assert found.decides == "regeneration"
    assert "regeneration decides" in found.words


def test_two_close_modes_that_are_stable_alone_grow_together() -> None:
    """Perpendicular modes at 18 and 19.5 Hz: each alone is stable to 22 mm, together they grow."""
    down = MillingProcess(4, 0.02, np.pi / 2, 800e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
    model = structure([18.0, 19.5], [1.0, 1.0 + np.pi / 2])
    found = judge_mode_coupling(model, down, SPEED / 2, 0.05)
    assert found.decides == "mode coupling"
    assert found.without_regeneration == pytest.approx(mode_coupling_limit(model, down, 0.05).depth)
    assert found.without_regeneration <= 1.1 * found.limit < found.alone
    each = [
        certified_lobes(structure([f], [d]), down, np.array([SPEED / 2]), 0.05).depth_limits[0]
        for f, d in ((18.0, 1.0), (19.5, 1.0 + np.pi / 2))
    ]
    assert found.alone == pytest.approx(min(each), rel=1e-9)
    assert "mode coupling decides" in found.words


def test_no_limit_is_said_to_be_none() -> None:
    stiff = structure([20.0], [0.6], mass=1e6)
    assert judge_mode_coupling(stiff, CUT, SPEED, 0.01).decides == "no limit"


def test_high_modes_left_static_keep_statics_and_limits() -> None:
    model = structure([18.0, 25.0, 900.0], [0.3, 1.4, 0.8])
    small = with_static_high_modes(model, 100.0)
    assert len(small.poles) == 2
    lines = np.array([0.0, 10.0, 30.0])
    assert (
        np.abs(small.receptance(lines) - model.receptance(lines)).max() < 2e-3 * np.abs(model.receptance(lines)).max()
    )
    speeds = np.array([100.0, 300.0])
    limits = [certified_lobes(one, CUT, speeds, 0.05).depth_limits for one in (model, small)]
    assert limits[1] == pytest.approx(limits[0], rel=2e-3)
