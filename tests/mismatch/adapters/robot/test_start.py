"""Starts against brute force over the numbers tried, and noise against the noise that was added."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import POSTURES, ROBOT, in_postures, milled, small_case

from millfrf.core import InputError
from millfrf.mismatch import predicted_spectrum
from millfrf.mismatch.robot.fit import (
    FreeFit,
    best_start,
    fit_from,
    fit_robot,
    free_fit,
    nearest,
    numbered,
    residual_of_fit,
    whiteners_of,
)
from millfrf.mismatch.robot.receptance import posed, quick_spectrum
from millfrf.robot_model import possible_changes, with_joint_factor

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
JOINT = CHANGES["joint 3 stiffness"]
SOFTER = with_joint_factor(ROBOT, "3", 0.7)


def test_what_is_left_is_the_log_of_each_channels_share() -> None:
    case = small_case(SOFTER)
    spectrum = case.recordings[0].spectrum
    rest = spectrum.measured - quick_spectrum(case.modes(())[0], spectrum)
    shares = [np.sum(np.abs(rest[:, k]) ** 2) / np.sum(np.abs(spectrum.measured[:, k]) ** 2) for k in range(3)]
    assert residual_of_fit(case, ()) == pytest.approx(len(spectrum.frequencies) * sum(np.log(shares)))
    assert residual_of_fit(case, ((JOINT, 0.7),)) < residual_of_fit(case, ()) - 100


def test_a_start_is_the_best_of_the_numbers_tried() -> None:
    case = small_case(SOFTER)
    tried = {number: residual_of_fit(case, ((JOINT, number),)) for number in JOINT.values}
    start, left = best_start(case, (), JOINT)
    assert left == min(tried.values())
    assert tried[start[0][1]] == left
    before = ((CHANGES["damping"], 1.2),)
    assert best_start(case, before, JOINT)[0][0] == before[0]
    companions = numbered(CHANGES["payload"], 3.0)[1:]
    assert [each.name for each, _ in companions] == [each.name for each in CHANGES["payload"].companions]
    assert all(number == each.neutral for each, number in companions)


def test_the_nearest_robot_is_the_one_as_modelled_unless_a_change_is_clearly_better() -> None:
    weighed = [JOINT, CHANGES["damping"]]
    assert nearest(small_case(), weighed, 20.0) == ()
    softer = small_case(SOFTER)
    assert [each.name for each, _ in nearest(softer, weighed, 20.0)] == [JOINT.name]
    assert nearest(softer, weighed, 1e9) == ()


def test_whitened_noise_is_white() -> None:
    """Three per cent of noise on forces and responses: what the true robot leaves has variance 1 in every channel."""
    recording = posed(milled(ROBOT, POSTURES[0], 0, seconds=24.0, noise=0.03), np.radians(POSTURES[0]), (5.0, 45.0))
    case = replace(small_case(), recordings=(recording,))
    spectrum = recording.spectrum
    flat = [np.broadcast_to(np.eye(3, dtype=complex), (len(spectrum.frequencies), 3, 3))]
    # so small a weight of the data that the modes stay those of the true robot
    right = fit_robot(case, (), [1e-9 * flat[0]])
    white = whiteners_of(case, right)[0]
    rest = spectrum.measured - predicted_spectrum(right.modes[0], spectrum)
    power = np.mean(np.abs(np.einsum("kij,kj->ki", white, rest)) ** 2, axis=0)
    assert power == pytest.approx(np.ones(3), rel=0.15)


def test_a_channel_at_rest_is_refused() -> None:
    still = milled(ROBOT, POSTURES[0], 0, seconds=6.0)
    still.response[:, 1] = 0.0
    case = replace(small_case(), recordings=(posed(still, np.radians(POSTURES[0]), (5.0, 45.0)),))
    with pytest.raises(InputError, match="a channel is zero"):
        free_fit(case, ())


def test_a_fit_starts_from_the_modes_seen_and_ends_at_the_truth() -> None:
    case = small_case(SOFTER)
    free = free_fit(case, ((JOINT, 0.75),))
    assert isinstance(free, FreeFit)
    fitted = fit_from(case, ((JOINT, 0.8),), free)
    assert abs(fitted.changes[0][1] - 0.7) < 3 * fitted.standard_errors[0]
    assert fitted.misfit >= free.fitted.misfit - 1.0  # nothing fits better than free modes


def test_a_part_of_a_free_fit_has_the_recordings_modes_and_noise() -> None:
    recordings = tuple(in_postures(ROBOT, 2, seconds=6.0))
    free = free_fit(replace(small_case(), recordings=recordings, counts=(4, 4)), ())
    part = free.only([1])
    assert part.fitted.modes == free.fitted.modes[1:]
    assert part.whiteners[0] is free.whiteners[1]
