"""Recordings left out: folds, errors of blocks against those of the spectrum, and what they say together."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import ROBOT, small_case

from estimation import WindowedSpectrum
from millfrf.mismatch import ROBOT as SETTINGS
from millfrf.mismatch import predicted_spectrum
from millfrf.mismatch.robot.fit import free_fit
from millfrf.mismatch.robot.receptance import RobotModes
from millfrf.mismatch.robot.results import (
    HeldOutTest,
    block_errors,
    folds_of,
    held_out_errors,
    held_out_test,
    improvement,
    lowers,
    raised,
)
from millfrf.robot_model import possible_changes, with_joint_factor

JOINT = next(one for one in possible_changes(ROBOT) if one.name == "joint 3 stiffness")
SOFTER = with_joint_factor(ROBOT, "3", 0.7)


def made(errors: list[float], factor: float = 1.0, count: int = 10) -> HeldOutTest:
    """Errors of recordings; blocks scatter about their squares and do not change but by a factor."""
    rng = np.random.default_rng(0)
    blocks = tuple(factor * each**2 * rng.uniform(0.8, 1.2, count) for each in errors)
    return HeldOutTest(np.zeros((len(errors), 0)), np.array(errors), np.full(len(errors), 0.03), blocks)


def relative_error(modes: RobotModes, spectrum: WindowedSpectrum) -> float:
    rest = spectrum.measured - predicted_spectrum(modes, spectrum)
    return float(np.linalg.norm(rest) / np.linalg.norm(spectrum.measured))


def test_two_recordings_are_left_out_in_turn() -> None:
    case = small_case(SOFTER, 2)
    near = ((JOINT, 0.7),)
    free = free_fit(case, near)
    folds = folds_of(case, free, near)
    assert [fold.name for fold in folds] == ["posture 1", "posture 2"]
    assert folds[0].others.recordings == (case.recordings[1],)
    assert folds[0].alone.recordings == (case.recordings[0],)
    assert folds[0].seen.fitted.modes == free.fitted.modes[1:]
    before, after = held_out_test(folds, ()), held_out_test(folds, near)
    assert before.numbers.shape == (2, 0)
    assert after.numbers.shape == (2, 1)
    assert np.abs(after.numbers - 0.7).max() < 0.05
    # what the true robot leaves is noise: free modes leave no more, and the number from the other recording hardly
    truth = zip(case.modes(near), case.recordings, strict=True)
    noise = np.array([relative_error(modes, each.spectrum) for modes, each in truth])
    assert (after.floors <= noise).all()
    assert (after.floors > 0.8 * noise).all()
    assert (after.errors < np.hypot(noise, 0.1 * before.errors)).all()


def test_a_single_recording_is_cut_in_two() -> None:
    case = small_case(seconds=12.0)
    folds = folds_of(case, free_fit(case, ()), ())
    assert [fold.name for fold in folds] == ["posture 1, first half", "posture 1, second half"]
    halves = [fold.alone.recordings[0].spectrum.recording for fold in folds]
    whole = case.recordings[0].spectrum.recording
    assert np.concatenate([half.force for half in halves]) == pytest.approx(whole.force)


def test_blocks_of_a_prediction_of_nothing_hold_all_of_the_response() -> None:
    case = small_case(seconds=20.0)
    spectrum = case.recordings[0].spectrum
    modes = case.modes(())[0]
    nothing = block_errors(replace(modes, shapes=0 * modes.shapes), spectrum)
    assert len(nothing) == len(spectrum.window) // int(spectrum.recording.rate)
    assert nothing.mean() == pytest.approx(1.0, rel=0.05)
    # Parseval: blocks of time and lines of the spectrum hold the same error
    assert np.sqrt(block_errors(modes, spectrum).mean()) == pytest.approx(relative_error(modes, spectrum), rel=0.1)


def test_a_fall_must_be_more_than_chance() -> None:
    before = made([0.5, 0.4])
    better, same = replace(made([0.3, 0.2], 0.4), floors=before.floors), made([0.499, 0.4])
    assert lowers(before, better)
    assert not lowers(before, before)
    assert not lowers(better, before)
    assert not lowers(before, replace(same, blocks=before.blocks))  # lower by nothing that blocks would show
    assert raised(better, before) == (0, 1)
    assert raised(before, better) == ()
    mixed = replace(before, errors=np.array([0.3, 0.6]), blocks=(0.4 * before.blocks[0], 2 * before.blocks[1]))
    assert raised(before, mixed) == (1,)
    few = made([0.5], count=5)
    assert not lowers(few, replace(few, errors=0.1 * few.errors, blocks=(0.01 * few.blocks[0],)))


def test_all_recordings_together_are_root_mean_squares() -> None:
    before, after = made([0.3, 0.4]), made([0.06, 0.08])
    after = replace(after, blocks=tuple(0.04 * each for each in before.blocks))
    gain = improvement(["a", "b"], before, after, SETTINGS.proof)
    assert gain.held_out == "a, b"
    assert gain.before == gain.refitted == pytest.approx(0.5 / np.sqrt(2))
    assert gain.after == pytest.approx(0.1 / np.sqrt(2))
    assert gain.noise_floor == pytest.approx(0.03)
    assert gain.interval == pytest.approx((0.2, 0.2))  # every block falls to a fifth
    assert gain.p_value < 1e-4
    assert gain.against == "nominal"
    assert before.beyond == pytest.approx(np.mean([0.09, 0.16]) - 0.03**2)
    rows = held_out_errors(["a", "b"], before, after)
    assert [(each.name, each.before, each.after, each.floor) for each in rows] == [
        ("a", 0.3, 0.06, 0.03),
        ("b", 0.4, 0.08, 0.03),
    ]


def test_a_recording_shorter_than_a_block_has_no_interval() -> None:
    short = replace(made([0.3]), blocks=(np.zeros(0),))
    gain = improvement(["a"], short, short, SETTINGS.proof)
    assert np.isnan(gain.interval).all()
    assert gain.p_value == 1.0
