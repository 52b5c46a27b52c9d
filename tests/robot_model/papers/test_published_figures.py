"""Figures of Mousavi et al. and Chen et al. that `docs/robot_papers.md` sets beside ours."""

import importlib.util
from math import pi
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    exact_receptance,
    in_posture,
    modal_model_at,
    read_spatial_robot,
    tool_down,
    turned_place,
)
from millfrf.stability import multipliers
from millfrf.steps.robot.maps import depth_over_redundancy

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "robot_paper_figures.py"


@pytest.fixture(scope="module")
def figures() -> ModuleType:
    specification = importlib.util.spec_from_file_location("robot_paper_figures", EXAMPLE)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_frequencies_vary_along_the_path(figures: ModuleType, tmp_path: Path) -> None:
    """Mousavi et al., Fig. 7: "vary up to 40 %". Neighbouring places differ little: it is one branch, without jumps."""
    table = figures.along_the_path()
    assert table[[0, -1], 0] == pytest.approx([10.3, 6.5], abs=0.05)
    assert 100 * figures.variations(table)[:3] == pytest.approx([37, 49, 28], abs=0.5)
    assert np.abs(np.diff(table, axis=0) / table[1:]).max() < 0.04
    figures.draw_path(tmp_path / "path.png")
    assert (tmp_path / "path.png").stat().st_size > 10_000


def test_printed_tables_do_not_give_the_published_peaks(figures: ModuleType, tmp_path: Path) -> None:
    """Chen et al., Fig. 7: first peaks with links are those of the exact chain, not the paper's."""
    lines = figures.LINES
    low = lines < 14
    flexible = figures.at_the_poses(links=True)
    result = {}
    for name, angles in figures.CHEN.poses.items():
        exact = np.abs(exact_receptance(figures.CHEN.robot, angles, lines[low]).values[:, 0, 0])
        result[name] = lines[low][np.argmax(flexible[name][low])]
        assert result[name] == pytest.approx(lines[low][np.argmax(exact)], abs=0.03)
        assert flexible[name][low].max() == pytest.approx(exact.max(), rel=0.02)
    first_modes = [
        in_posture(figures.CHEN, angles, links=True).frequencies[0] for angles in figures.CHEN.poses.values()
    ]
    assert first_modes == pytest.approx([11.63, 11.42, 10.99], abs=0.005)
    assert list(result.values()) == pytest.approx(first_modes, abs=0.05)  # a damped peak lies a little lower
    for name, first in result.items():
        assert abs(first / figures.CHEN.predicted[name] - 1) > 0.09
        assert abs(first / figures.CHEN.measured[name] - 1) > 0.09
    figures.draw_frfs(tmp_path / "frfs.png")
    assert (tmp_path / "frfs.png").stat().st_size > 10_000


def test_the_best_and_the_worst_turn_of_the_redundancy() -> None:
    """Mousavi et al., Fig. 11: 4 mm chatter upright (limit 3.17 mm) and are stable turned by 90 degrees (4.64 mm)."""
    case = read_spatial_robot("staubli_rx170")
    cut = MillingProcess(2, 0.02, pi / 2, 700e6, 0.3, 0.1, pi / 2, pi, 1e-4)
    place, turns = tool_down([1.1, 0.0, 0.85], pi), np.array([0.0, pi / 2])
    result = depth_over_redundancy(case.robot, place, turns, cut, 200 * pi, 0.02, "table")
    assert 1e3 * result.values == pytest.approx([3.17, 4.64], abs=0.01)
    for turn, q, stable in zip(turns, result.q, (False, True), strict=True):
        model = modal_model_at(case.robot, q, axes=turned_place(place, turn, "table").axes)
        assert multipliers(model, cut, 200 * pi, 4e-3).stable == stable
