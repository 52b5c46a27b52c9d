"""Dry friction in both joints of an arm is named in both, with its moments, from short recordings; in one, in one."""

import numpy as np
import pytest
from two_link_arm import arm_model, arm_recording, integrated, torques

from estimation import BandRecording
from millfrf.mismatch import diagnose
from millfrf.reports.diagnoses.answers import place

RATE, SECONDS = 50.0, 12.0


def _recording(name: str, level: float, seed: int, friction: tuple[float, float]) -> BandRecording:
    torque = torques(RATE, SECONDS, level, seed)
    angles = integrated(torque, RATE, friction)
    angles += 0.005 * angles.std(axis=0) * np.random.default_rng(seed).standard_normal(angles.shape)
    return arm_recording(name, RATE, torque, angles)


@pytest.mark.long
@pytest.mark.parametrize("friction", [(0.12, 0.08), (0.12, 0.0)])
def test_friction_of_an_arm_is_named_in_each_joint_that_has_it(friction: tuple[float, float]) -> None:
    recordings = [_recording(f"run_{k}", 0.8 + 0.3 * k, k, friction) for k in range(3)]
    diagnosis = diagnose(arm_model(), recordings)
    due = [moment for moment in friction if moment > 0]
    assert [cause.name for cause in diagnosis.physics] == ["coulomb_friction"] * len(due)
    assert diagnosis.verdict == "explained"
    for cause, moment, axis in zip(diagnosis.physics, due, np.eye(2), strict=False):
        assert cause.parameters["friction_nm"] == pytest.approx(moment, rel=0.05)
        assert abs(np.dot(cause.location["direction"], axis)) > 0.98
    if len(due) > 1:
        stated = [place(diagnosis, cause) for cause in diagnosis.physics]
        assert all(f"in a joint at J{number} " in text for number, text in zip((1, 2), stated, strict=True))
