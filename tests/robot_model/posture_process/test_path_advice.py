"""Advice along a path: advised cuts are stable in simulated cells that share no code with the program."""

from dataclasses import replace

import numpy as np
import pytest
from measured_cell import measured_cell, true_model
from nonlinear_cell import NonlinearCell, drawn_postures
from numpy.typing import NDArray
from trial import CUT

from millfrf.core import InputError
from millfrf.robot_model import CutPath, cut_path, learn_postures, path_segments, reached_near
from millfrf.robot_model.posture_process.modal_basis import basis_at, corrected_modes
from millfrf.stability import DRIFT, multipliers
from millfrf.steps.robot.along_path.advice import (
    AdvisedCut,
    PathAdvice,
    PredictedLimits,
    SegmentAdvice,
    advise_along,
)
from millfrf.steps.robot.along_path.advice_results import COLUMNS, advice_sentences, advice_table, advice_warnings
from modal_fit import ModalModel

Real = NDArray[np.float64]

ADVISED = AdvisedCut(CUT, np.array([2600.0, 3000.0, 3400.0]) * np.pi / 30, 0.05)


def straight(tip: Real, towards: Real, length: float, points: int) -> CutPath:
    """A path from a tool frame (4, 4) in a direction of the tool frame; the tool does not turn."""
    steps = np.linspace(0.0, length, points)[:, None] * (tip[:3, :3] @ towards)
    return cut_path(tip[:3, 3] + steps, np.tile(tip[:3, :3], (points, 1, 1)))


def true_in_the_cut(cell: NonlinearCell, q: Real, axes: Real) -> ModalModel:
    """The true modes at the tip in feed, normal and axial direction."""
    model = true_model(cell, q)
    return replace(model, right=model.right @ axes, left=model.left @ axes)


def stable_cuts(seed: int, paths: int = 2, segments: int = 2) -> tuple[int, int]:
    """Number of advised segments in a cell, and of those stable in the true robot everywhere that is tried."""
    cell = measured_cell(seed)
    learned = learn_postures(cell.robot, cell.measured)
    mechanism = cell.robot.mechanism
    advised = stable = 0
    for q in drawn_postures(np.random.default_rng([seed, 2]), paths):
        path = straight(mechanism.tool_transform(q), np.array([1.0, 0.0, 0.0]), 0.12, segments + 1)
        parts = path_segments(path)
        advice = advise_along(learned, path, parts, ADVISED, q, None)
        near = q
        for each, part in zip(advice.segments, parts, strict=True):
            speed = advice.speed(each)
            depth = advice.depth(each, speed)
            holds = True
            for place in part.places:
                result = reached_near(cell.robot, place, near)
                assert result is not None
                near = result
                truth = true_in_the_cut(cell.cell, near, place.axes)
                speeds = ADVISED.speeds[speed] * (1 + DRIFT * np.array([-1.0, -0.4, 0.3, 1.0]))
                holds &= all(
                    multipliers(truth, CUT, float(rate), float(share * depth)).stable
                    for rate in speeds
                    for share in (0.5, 1.0)
                )
            advised += np.isfinite(depth)
            stable += np.isfinite(depth) and holds
    return int(advised), int(stable)


@pytest.mark.slow
def test_advised_cuts_are_stable_in_the_true_robot() -> None:
    result = np.array([stable_cuts(seed) for seed in (100, 101, 102)])
    advised, stable = result.sum(axis=0)
    assert advised >= 8
    assert stable == advised


def advice_of(*limits: PredictedLimits) -> PathAdvice:
    """Advice with given limits in the segments of a straight path, at 2000 and 3000 rpm up to 10 mm."""
    path = straight(np.eye(4), np.array([1.0, 0.0, 0.0]), 0.1 * len(limits), len(limits) + 1)
    cut = AdvisedCut(CUT, np.array([2000.0, 3000.0]) * np.pi / 30, 0.01)
    return PathAdvice(cut, tuple(SegmentAdvice(*each) for each in zip(path_segments(path), limits, strict=True)))


def limits_of(low: tuple[float, float], left: float = 0.1) -> PredictedLimits:
    """Limits with a low end of the band at both speeds, and a share of the variance that is left."""
    ends = np.array(low)
    return PredictedLimits(ends, 1.2 * ends, 1.5 * ends, np.array([20.0, 30.0]), left, left > 0.5)


def test_the_speed_has_the_largest_removal_rate_and_the_common_one_that_of_the_worst_segment() -> None:
    advice = advice_of(limits_of((4e-3, 2e-3)), limits_of((2e-3, 1.9e-3)), limits_of((1e-3, 8e-3)))
    assert [advice.speed(each) for each in advice.segments] == [0, 1, 1]  # 4 x 2 > 2 x 3; 1.9 x 3 > 2 x 2
    assert advice.common_speed() == 1  # min(4, 2, 1) x 2 < min(2, 1.9, 8) x 3
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in advice_table(advice)]
    assert [row["depth_m"] for row in rows] == [4e-3, 1.9e-3, 8e-3]
    assert [row["depth_at_common_speed_m"] for row in rows] == [2e-3, 1.9e-3, 8e-3]
    assert [row["spindle_speed_rpm"] for row in rows] == pytest.approx([2000, 3000, 3000])
    assert "1.9 mm deep" in advice_sentences(advice)[1]


def test_a_far_segment_gets_no_depth_and_no_say_in_the_common_speed() -> None:
    advice = advice_of(limits_of((4e-3, 2e-3)), limits_of((1e-4, 9e-3), 0.7), limits_of((0.0, 0.0)))
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in advice_table(advice)]
    assert [row["measured"] for row in rows] == ["yes", "far", "yes"]
    empty = (rows[1]["depth_m"], rows[1]["depth_at_common_speed_m"], rows[2]["depth_m"])
    assert [str(depth) for depth in empty] == ["nan"] * 3
    assert "far from every measured posture (70 %" in str(rows[1]["note"])
    assert "no depth holds" in str(rows[2]["note"])
    assert "1 of 3 segments (first 2)" in advice_warnings(advice)[0]
    nowhere = advice_of(limits_of((4e-3, 2e-3), 0.8))
    assert advice_sentences(nowhere) == ["no advice: all of 1 segment lie far from every measured posture"]


def test_a_path_out_of_reach_is_refused() -> None:
    cell = measured_cell(100, 2)
    learned = learn_postures(cell.robot, cell.measured)
    path = straight(np.diag([1.0, -1.0, -1.0, 1.0]), np.array([1.0, 0.0, 0.0]), 9.0, 3)
    with pytest.raises(InputError, match="does not reach x"):
        advise_along(learned, path, path_segments(path), ADVISED, cell.postures[0], None)


def test_modes_have_signs_that_rounding_does_not_change() -> None:
    """Draws of shapes are relative to the tip's motion: with the solver's signs, near postures had other draws."""
    robot = measured_cell(100, 2).robot
    for q in drawn_postures(np.random.default_rng(5), 4):
        basis, _ = basis_at(robot, q)
        tip = corrected_modes(basis, np.zeros(len(basis.stiffness)), np.zeros(len(basis.mass))).tip
        assert (tip[np.arange(len(tip)), np.abs(tip).argmax(axis=1)] > 0).all()
