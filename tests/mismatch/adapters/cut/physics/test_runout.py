"""Runout against the path of edges about another axis."""

import math

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.mismatch.cut.hypothesis import view_of
from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.physics import cut_library
from millfrf.mismatch.cut.recordings import CutRecording

RUNOUT = cut_library()["runout"]
LAW = SpindleLaw(0.5, 0.2, 90.0)
RECORDING = CutRecording("r", 5000.0, np.zeros((5000, 3)), (0, 1, 2), None, LAW, 0.1)


def _process(teeth: int, runout: float = 0.0) -> MillingProcess:
    return MillingProcess(teeth, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4, runout=runout)


def test_edges_stand_out_by_the_projection_of_the_offset() -> None:
    """The axis is off by (p, q): an edge at angle ``2 pi j / N`` runs ``p cos + q sin`` large."""
    process = _process(4)
    values = np.array([7e-6, -3e-6])
    for tooth in view_of(RECORDING, process, LAW, 1).teeth:
        for earlier in range(3):
            angle = 2 * math.pi * (tooth.number + earlier) / 4
            offset = 7e-6 * math.cos(angle) - 3e-6 * math.sin(angle)
            assert RUNOUT.advance(values, tooth, earlier) == pytest.approx(offset * math.sin(math.radians(70)))


def test_radius_and_angle_have_the_errors_of_a_draw() -> None:
    process, values = _process(3), np.array([10e-6, 3e-6])
    covariance = 1e-14 * np.array([[4.0, 1.0], [1.0, 2.0]])
    named, errors = RUNOUT.named_numbers(values, covariance, process)
    draws = np.random.default_rng(1).multivariate_normal(values, covariance, 20000)
    assert named["radial_offset_m"] == pytest.approx(math.hypot(*values))
    assert named["angle_rad"] == pytest.approx(math.atan2(3, 10))
    assert errors["radial_offset_m"] == pytest.approx(np.hypot(*draws.T).std(), rel=0.03)
    assert errors["angle_rad"] == pytest.approx(np.arctan2(draws[:, 1], draws[:, 0]).std(), rel=0.03)


def test_two_teeth_show_one_number_and_one_tooth_none() -> None:
    assert len(RUNOUT.parameters(_process(2))) == 1
    assert RUNOUT.named_numbers(np.array([-5e-6]), np.array([[1e-14]]), _process(2)) == (
        {"radial_offset_m": 5e-6},
        {"radial_offset_m": 1e-7},
    )
    assert RUNOUT.obstacle(_process(1)) == "one tooth alone shows none"
    assert RUNOUT.stated(_process(3, 8e-6)).tolist() == [8e-6, 0.0]
    assert RUNOUT.improved(_process(3), np.array([3e-6, 4e-6])).runout == pytest.approx(5e-6)
