"""Learned postures of a cell that shares no code with the package: coverage, files, and the warning far away."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from measured_cell import MeasuredCell, measured_cell, true_model
from nonlinear_cell import drawn_postures

from millfrf.core import FileFormatError, InputError, accepting_edited, write_json
from millfrf.robot_model import (
    LearnedPostures,
    choose_postures,
    learn_postures,
    left_out_postures,
    modes_at,
    predict_posture,
    read_learned_postures,
    with_joint_factor,
    write_learned_postures,
)
from millfrf.robot_model.posture_process.modal_basis import mode_pairs


@pytest.fixture(scope="module")
def cell() -> MeasuredCell:
    return measured_cell(2, 8)


@pytest.fixture(scope="module")
def learned(cell: MeasuredCell) -> LearnedPostures:
    return learn_postures(cell.robot, cell.measured)


@pytest.mark.long
def test_bands_hold_new_postures_and_are_narrower_than_the_models_error(
    cell: MeasuredCell, learned: LearnedPostures
) -> None:
    held, modelled, predicted = [], [], []
    for q in drawn_postures(np.random.default_rng(99), 8):
        result, truth = predict_posture(learned, q), true_model(cell.cell, q)
        frequency, damping = result.frequency_band(), result.damping_band()
        model = result.model
        pairs = mode_pairs(
            truth.natural_frequencies[:6], truth.right.real[:6], model.natural_frequencies, model.right.real
        )
        for i, r in pairs:
            f, z = truth.natural_frequencies[i], truth.damping_ratios[i]
            held.append([frequency[0, r] <= f <= frequency[1, r], damping[0, r] <= z <= damping[1, r]])
            predicted.append(np.log(model.natural_frequencies[r] / f))
            modelled.append(np.log(modes_at(cell.robot, q).frequencies[i] / f))
    # of 48 bands at 95 %, fewer than 41 hold once in a thousand cells
    assert np.sum(held, axis=0).min() >= 41
    assert np.std(predicted) < 0.5 * np.sqrt(np.mean(np.square(modelled)))


def test_the_file_gives_the_same_predictions_and_refuses_another_robot(
    cell: MeasuredCell, learned: LearnedPostures, tmp_path: Path
) -> None:
    path, q = tmp_path / "postures.json", cell.postures[0] + 0.1
    write_learned_postures(path, learned)
    first, second = predict_posture(learned, q), predict_posture(read_learned_postures(path, cell.robot), q)
    assert second.model.poles == pytest.approx(first.model.poles, rel=1e-9)
    assert second.frequency_band() == pytest.approx(first.frequency_band(), rel=1e-9)
    with pytest.raises(InputError, match="another robot"):
        read_learned_postures(path, with_joint_factor(cell.robot, "2", 0.9))
    path.write_text(path.read_text().replace('"damping_ratio"', '"damping"'))
    with pytest.raises(FileFormatError, match="edited after it was written"):
        read_learned_postures(path, cell.robot)
    with accepting_edited(), pytest.raises(FileFormatError, match="damping_ratio"):
        read_learned_postures(path, cell.robot)


@pytest.mark.parametrize("wrong", [-1e9, 0.0, 1e20])
@pytest.mark.parametrize(
    ("group", "name"), [("hyperparameters", "draws"), ("hyperparameters", "best"), ("mass_factors", "")]
)
def test_a_factor_that_is_not_positive_or_too_large_is_refused(
    group: str, name: str, wrong: float, cell: MeasuredCell, learned: LearnedPostures, tmp_path: Path
) -> None:
    """Before: "the program met something that it does not foresee", from the logarithm of a negative number."""
    path = tmp_path / "postures.json"
    write_learned_postures(path, learned)
    content = json.loads(path.read_text())
    holder = content[group][name] if name else content[group]
    if name == "draws":
        holder[0][1] = wrong
    else:
        holder[next(iter(holder))] = wrong
    write_json(path, content)
    with pytest.raises(FileFormatError, match=rf"{name or group}.*must be (above|below)"):
        read_learned_postures(path, cell.robot)


def test_far_from_all_postures_the_band_is_wide_and_the_answer_says_so(
    cell: MeasuredCell, learned: LearnedPostures
) -> None:
    here = predict_posture(learned, cell.postures[0])
    away = predict_posture(learned, np.radians([170.0, -95.0, -20.0, 180.0, -110.0, 180.0]))
    assert away.remaining_variance > here.remaining_variance
    widths = [np.log(each.frequency_band()[1] / each.frequency_band()[0])[:6].mean() for each in (here, away)]
    assert widths[1] > 1.3 * widths[0]
    assert not here.warnings


@pytest.mark.long
def test_bands_hold_postures_left_out_and_a_wrong_posture_shows(cell: MeasuredCell, learned: LearnedPostures) -> None:
    result = left_out_postures(learned)
    held = np.vstack([each.held for each in result])
    assert len(held) == 48
    assert held.sum(axis=0).min() >= 41
    wrong = list(cell.measured)
    wrong[2] = replace(wrong[2], driven=wrong[2].driven + np.radians([0.0, 35.0, -30.0, 0.0, 0.0, 0.0]))
    bent = left_out_postures(learn_postures(cell.robot, wrong))
    size = [float(np.abs(each.errors[:, 0]).max(initial=0.0)) for each in bent]
    assert int(np.argmax(size)) == 2


def test_the_next_posture_lies_where_predictions_matter(cell: MeasuredCell, learned: LearnedPostures) -> None:
    targets = np.radians([[50.0, 40, 50, 80, 40, 0], [45, 35, 55, 85, 45, 10]])
    offered = np.vstack([drawn_postures(np.random.default_rng(5), 4), targets.mean(axis=0)])
    first, second = choose_postures(learned, offered, targets, 2)
    assert first.driven == pytest.approx(targets.mean(axis=0))
    assert first.after < 0.9 * first.before
    # the error expected after the first posture is the error before the second
    assert second.before == pytest.approx(first.after, rel=1e-6)
    assert second.after <= second.before
    with pytest.raises(InputError, match="candidates"):
        choose_postures(learned, offered, targets, 9)


def test_one_posture_is_refused(cell: MeasuredCell) -> None:
    with pytest.raises(InputError, match="two or more"):
        learn_postures(cell.robot, cell.measured[:1])
