"""Concealed causes found: recordings simulated by another integrator, whole diagnoses, and the files they end in."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from concealed_recordings import RATE, Concealed, Law, forces, late, linear_acceleration, trial

from estimation import BandRecording
from millfrf.mismatch import (
    Settings,
    StructureDiagnosis,
    diagnose,
    improved_model_of,
    library,
    predict,
    write_diagnosis,
)
from modal_fit import ModalModel, read_modal_model, write_modal_model

DIRECTION = np.array([0.8, -0.6])


def _trials(model: ModalModel, law: Law, seed: int = 5) -> list[BandRecording]:
    rng = np.random.default_rng(seed)
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        made.append(trial(name, force, Concealed(law, DIRECTION).acceleration(model, force), rng))
    return made


def test_nothing_is_found_where_nothing_is(model: ModalModel, linear_trials: list[BandRecording]) -> None:
    diagnosis = diagnose(model, linear_trials)
    assert diagnosis.verdict == "none"
    assert diagnosis.physics == ()
    assert diagnosis.improvement.after < 1.15 * diagnosis.improvement.noise_floor


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "law", "numbers"),
    [
        ("stiffness_hardening", lambda x, v: 2e9 * x**3, {"force_at_1mm_n": 2.0, "exponent": 3.0}),
        ("coulomb_friction", lambda x, v: 12 * np.tanh(v / 2e-3), {"friction_n": 12.0}),
    ],
)
def test_a_joint_law_is_found_with_its_direction_and_numbers(
    model: ModalModel, name: str, law: Law, numbers: dict[str, float]
) -> None:
    diagnosis = diagnose(model, _trials(model, law))
    assert diagnosis.verdict == "explained"
    assert [cause.name for cause in diagnosis.physics] == [name]
    direction = np.array(diagnosis.physics[0].location["direction"])
    assert abs(direction @ DIRECTION) > np.cos(np.radians(3))
    for key, value in numbers.items():
        assert diagnosis.physics[0].parameters[key] == pytest.approx(value, rel=0.05)
    assert diagnosis.improvement.after < 1.2 * diagnosis.improvement.noise_floor
    assert diagnosis.improvement.p_value < 0.01


@pytest.mark.long
def test_a_delay_is_found_and_ends_in_files(model: ModalModel, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = forces(rng, level, 24.0)
        made.append(trial(name, force, late(linear_acceleration(model, force), RATE, 3e-3), rng))
    diagnosis = diagnose(model, made)
    assert [cause.name for cause in diagnosis.physics] == ["channel_delay"]
    cause = diagnosis.physics[0]
    assert abs(cause.parameters["delay_s"] - 3e-3) < 4 * cause.standard_errors["delay_s"] + 1e-5
    _round_trip(diagnosis, made[1], model, tmp_path)


def _round_trip(found: StructureDiagnosis, recording: BandRecording, model: ModalModel, folder: Path) -> None:
    write_diagnosis(folder / "diagnosis.json", found)
    content = json.loads((folder / "diagnosis.json").read_text())
    assert content["format"] == "millfrf.diagnosis"
    assert content["verdict"] == "explained"
    write_modal_model(folder / "improved.json", improved_model_of(found))
    improved = predict(read_modal_model(folder / "improved.json"), recording)
    assert improved.total_error < 0.3 * predict(model, recording).total_error


@pytest.mark.long
def test_what_the_library_does_not_have_is_not_named(model: ModalModel) -> None:
    """Without the law in the library, its effect is unlisted or unexplained rather than given another name."""
    known = {
        name: cause
        for name, cause in library().items()
        if name not in ("coulomb_friction", "presliding_friction", "hysteresis", "quadratic_damping")
    }
    made = _trials(model, lambda x, v: 25 * float(np.tanh(v / 2e-3)))
    diagnosis = diagnose(model, made, Settings(causes=known))
    assert diagnosis.verdict == "unlisted"
    assert diagnosis.physics == ()


def test_a_wrong_nominal_model_is_modal_parameters(model: ModalModel, linear_trials: list[BandRecording]) -> None:
    off = replace(model, poles=model.poles * np.array([1.06, 0.94]))
    diagnosis = diagnose(off, linear_trials)
    assert [cause.name for cause in diagnosis.physics] == ["modal_parameters"]
    assert diagnosis.improvement.after < 1.15 * diagnosis.improvement.noise_floor
