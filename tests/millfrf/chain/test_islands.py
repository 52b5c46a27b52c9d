"""Depths that are stable above an island: those of all limits, and none where the lowest limits disagree."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove, lobes_figure
from millfrf.reports.lobes_check import stable_above
from millfrf.stability import StabilityLobes, certified_lobes, multipliers
from modal_fit import ModalModel
from replay_data import default_structure, tip_model

CUT = MillingProcess(2, 12.7e-3, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
SPEEDS = np.array([1000.0, 1040.0, 1300.0]) * np.pi / 30
DEEPEST = 0.02


@pytest.fixture(scope="module")
def structure() -> ModalModel:
    return tip_model(default_structure())


@pytest.fixture(scope="module")
def lobes(structure: ModalModel) -> StabilityLobes:
    return certified_lobes(structure, CUT, SPEEDS, DEEPEST)


def test_a_range_above_an_island_is_stable_by_its_multipliers_and_what_is_around_it_is_not(
    structure: ModalModel, lobes: StabilityLobes
) -> None:
    ranges = stable_above(structure, CUT, lobes, DEEPEST)
    assert ranges, "this cut has an island at 1040 rpm"
    for each in ranges:
        speed = each.spindle_speed_rpm * np.pi / 30
        assert multipliers(structure, CUT, speed, (each.low + each.high) / 2).stable
        assert not multipliers(structure, CUT, speed, 0.98 * each.low).stable
        assert each.high == DEEPEST or not multipliers(structure, CUT, speed, 1.02 * each.high).stable


def test_nothing_is_told_where_the_lowest_limits_disagree(structure: ModalModel, lobes: StabilityLobes) -> None:
    other = replace(lobes, depth_limits=1.2 * lobes.depth_limits)
    assert stable_above(structure, CUT, other, DEEPEST) == ()


def test_nothing_is_told_of_an_frf(structure: ModalModel, lobes: StabilityLobes) -> None:
    assert stable_above(structure.frf(np.linspace(1, 200, 400)), CUT, lobes, DEEPEST) == ()


def test_the_field_lies_where_the_range_is(lobes: StabilityLobes, tmp_path: Path) -> None:
    figure = lobes_figure({"one": lobes}, stable_above=[StableAbove(1040.0, 5e-3, 6e-3)])
    fields = [patch for patch in figure.axes[0].patches if patch.get_label() == "stable above an island"]
    [field] = fields
    assert (field.get_y(), field.get_height()) == pytest.approx((5.0, 1.0))
    assert field.get_x() < 1040.0 < field.get_x() + field.get_width()
    assert any("stable above an island" in text.get_text() for text in figure.legends[0].get_texts())
