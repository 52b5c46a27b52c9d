"""Modes at tip and housing against the robot's own receptance, their derivatives, and predictions of recordings."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import BAND, NOTHING, POSTURES, ROBOT, in_postures, milled

from millfrf.mismatch import LabError, PosedRecording, predicted_spectrum
from millfrf.mismatch.robot.receptance import RobotModes, posed, robot_modes
from millfrf.robot_model import SpatialRobot, cell_structure_at, with_joint_factor
from millfrf.robot_model.spatial.spatial_modes import frf_at


def some_modes(robot: SpatialRobot = ROBOT) -> tuple[RobotModes, PosedRecording]:
    recording = in_postures(ROBOT, 1, seconds=6.0)[0]
    return robot_modes(robot, recording, NOTHING, np.zeros(3), 6), recording


def test_receptance_at_tip_and_housing_is_that_of_the_robot() -> None:
    modes, recording = some_modes()
    lines = np.array([3.0, 17.0, 40.0])
    assert modes.receptance(lines) == pytest.approx(frf_at(ROBOT, recording.q, lines).values, rel=1e-9, abs=1e-15)
    sensor = np.array([0.06, -0.04, 0.25])
    housing = replace(recording, responses=("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z"))
    result = robot_modes(ROBOT, housing, NOTHING, sensor, 6).receptance(lines)
    structure = cell_structure_at(ROBOT, recording.q, sensor, highest_frequency=1e5)
    assert result == pytest.approx(structure.receptance(lines)[:, 3:], rel=1e-6, abs=1e-13)


def test_slopes_are_the_derivative() -> None:
    modes, recording = some_modes()
    error, rng = LabError(0.01, 0.15, 0.05), np.random.default_rng(3)
    lines = recording.spectrum
    u = 0.3 * rng.normal(size=modes.size)
    here = modes.moved(u, error)
    slopes = here.slopes(modes, lines.frequencies, lines.force_here, error)

    def displacement(x: np.ndarray) -> np.ndarray:
        return np.einsum("kpq,kq->kp", modes.moved(x, error).receptance(lines.frequencies), lines.force_here)

    for column in rng.choice(modes.size, 12, replace=False):
        aside = 1e-5 * np.eye(modes.size)[column]
        numeric = (displacement(u + aside) - displacement(u - aside)) / 2e-5
        assert np.abs(slopes[:, :, column] - numeric).max() <= 1e-6 * max(np.abs(numeric).max(), 1e-12)


def test_deviations_lead_from_one_robot_to_another_whatever_the_order_and_the_signs() -> None:
    error = LabError(0.01, 0.15, 0.05)
    modes, _ = some_modes()
    softer, _ = some_modes(with_joint_factor(ROBOT, "1", 0.55))  # its two lowest modes have crossed
    shown = modes.moved(modes.deviations(softer, error), error)
    assert np.sort(shown.natural[:6]) == pytest.approx(np.sort(softer.natural[:6]), rel=1e-9)
    lines = np.linspace(5, 40, 30)
    other = softer.aligned(modes)
    signs = np.sign(np.sum(other.shapes[:6] * shown.shapes[:6], axis=1))
    assert other.shapes[:6] == pytest.approx(signs[:, None] * shown.shapes[:6], abs=1e-12)
    assert other.receptance(lines) == pytest.approx(softer.receptance(lines), rel=1e-9, abs=1e-15)


def test_prediction_meets_a_recording_without_noise() -> None:
    trial = milled(ROBOT, POSTURES[0], 0, noise=0.0)
    recording = posed(trial, np.radians(POSTURES[0]), BAND)
    predicted = predicted_spectrum(robot_modes(ROBOT, recording, NOTHING, np.zeros(3), 6), recording.spectrum)
    rest = np.linalg.norm(recording.spectrum.measured - predicted)
    assert rest < 0.02 * np.linalg.norm(recording.spectrum.measured)
