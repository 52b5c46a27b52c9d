"""The trial of `learn`: its truth is that of an independent judge, and what it counts is what happened."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # benchmarks are no installed package

from benchmarks import learning_trial
from millfrf.stability import multipliers


def test_the_judge_agrees_with_the_multipliers() -> None:
    for number in range(4):
        cell = learning_trial.WrongCell.drawn(number, 3)
        for speed, depth in ((cell.speeds[1], 2e-3), (cell.speeds[5], 8e-3)):
            result = multipliers(cell.true_model, cell.true_process, float(speed), depth).spectral_radius
            assert learning_trial.radius(*cell.judged, float(speed), depth) == pytest.approx(result, rel=1e-3)


def test_a_cell_of_two_cuts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learning_trial, "CUTS", 2)
    monkeypatch.setattr(learning_trial, "WRONG", 0.0)
    cell = learning_trial.run_cell(0, 1)
    assert len(cell["cuts"]) == 2
    assert len(cell["advised"]) == 3
    assert not cell["contradictions"]
    assert all(max(each["radii"]) < 1 for each in cell["advised"])
    text = learning_trial.table_of([cell])
    assert "unstable 0" in text
    assert "wrong verdicts 0 of 2" in text


@pytest.mark.slow
def test_ten_cuts_of_five_cells_bring_limits_near_the_truth() -> None:
    results = [learning_trial.run_cell(number, 2) for number in range(5)]
    errors: dict[str, list[float]] = {"before": [], "after": []}
    for cell in results:
        if cell["contradictions"]:
            continue
        true = np.array(cell["true"])
        for when, result in errors.items():
            result += np.abs(np.log(np.array(cell[when])[1] / true))[true < learning_trial.MAX_DEPTH].tolist()
        assert all(each["radii"][1] < 1 for each in cell["advised"] if "depth" in each)
    assert np.median(errors["after"]) < 0.5 * np.median(errors["before"])
