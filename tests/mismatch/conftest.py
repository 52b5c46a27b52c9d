"""Fixtures of the diagnosis' tests: small structures, recordings of them, and diagnoses whose residual is known."""

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from estimation import BandRecording, channels_of, windowed_spectrum
from millfrf.mismatch import Diagnosis, Hypothesis, LabError, ModelShape, StructureDiagnosis, predict_lines
from millfrf.mismatch.inference.diagnosis import Improvement, Remainder
from millfrf.mismatch.location.residual_view import StructureDetails
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.bands import compared_band
from millfrf.mismatch.records.noise_model import KNOTS, NoiseModel
from millfrf.mismatch.records.reading import band_of
from modal_fit import ModalModel, write_modal_model


def _loaded(name: str) -> ModuleType:
    """A file beside this one: test folders are no packages."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


_MODULE = _loaded("concealed_recordings")
_loaded("two_link_arm")
_RIG = _loaded("one_mode_rig")
_loaded("hidden_joint")
_loaded("trial_case")


@pytest.fixture(scope="session")
def rig_files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    """A linear rig of one mode at 10 Hz: its model, which holds from 4 to 22 Hz, and recordings at two levels."""
    folder, rig = tmp_path_factory.mktemp("rig"), _RIG.Rig()
    write_modal_model(folder / "model.json", replace(rig.model, band=(4.0, 22.0)))
    return folder / "model.json", [_RIG.written(folder, each) for each in rig.recordings((20.0, 60.0), 20.0)]


@pytest.fixture(scope="session")
def model() -> ModalModel:
    return _MODULE.structure()


@pytest.fixture(scope="session")
def linear_trials() -> list[BandRecording]:
    rng = np.random.default_rng(3)
    made = []
    for name, level in (("low", 20.0), ("high", 60.0)):
        force = _MODULE.forces(rng, level, 24.0)
        made.append(_MODULE.trial(name, force, _MODULE.linear_acceleration(_MODULE.structure(), force), rng))
    return made


RATE, NOISE = 128.0, 0.02
FORCES = channels_of("force", ("TCP:+X", "TCP:+Y"), ("fx", "fy"))
MOTIONS = channels_of("acceleration", ("TCP:+X", "TCP:+Y"), ("ax", "ay"))


@pytest.fixture(scope="package")
def small_model() -> ModalModel:
    """Two modes at 6 and 14 Hz seen in x and y."""
    omega, zeta = 2 * np.pi * np.array([6.0, 14.0]), np.array([0.03, 0.02])
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    shapes = np.array([[1.0, 0.4], [-0.3, 1.0]])
    left = shapes / (2j * omega[:, None] * 40.0)
    return ModalModel(
        quantity="receptance",
        unit="m/N",
        responses=("TCP:+X", "TCP:+Y"),
        excitations=("TCP:+X", "TCP:+Y"),
        poles=poles,
        right=shapes.astype(complex),
        left=left,
    )


@pytest.fixture(scope="package")
def trial_of() -> Callable[[ModalModel, str, float, int], BandRecording]:
    """Makes trials."""
    return _trial


@pytest.fixture(scope="package")
def hand_made() -> Callable[[ModalModel, list[BandRecording]], StructureDiagnosis]:
    """Makes diagnoses without diagnosing."""
    return _hand_made


def _trial(model: ModalModel, name: str, level: float, seed: int) -> BandRecording:
    """Broadband forces through the model, plus white noise on the accelerations."""
    rng = np.random.default_rng(seed)
    n = int(40 * RATE)
    force = level * rng.normal(size=(n, 2))
    empty = BandRecording(name, RATE, force, np.zeros((n, 2)), FORCES, MOTIONS)
    lines = windowed_spectrum(empty, band_of(model, RATE), 1.0)
    shape = ModelShape(model, LabError())
    response = lines.signal(predict_lines(Hypothesis(shape, np.zeros(shape.size)), lines).spectrum)
    return BandRecording(name, RATE, force, response + NOISE * rng.normal(size=(n, 2)), FORCES, MOTIONS)


def _hand_made(model: ModalModel, trials: list[BandRecording]) -> StructureDiagnosis:
    """A diagnosis whose two fits are the true linear model with the true noise."""
    lines = tuple(windowed_spectrum(trial, band_of(model, RATE), 1.0) for trial in trials)
    shape = ModelShape(model, LabError())
    knots = np.log(np.geomspace(lines[0].frequencies[0], lines[0].frequencies[-1], KNOTS))
    noise = NoiseModel(knots, np.full((2, KNOTS), np.log(NOISE**2)), np.full(2, -60.0))
    hypothesis = Hypothesis(shape, np.zeros(shape.size))
    fitted = Fit(hypothesis, (noise,) * len(lines), 0.0, 0.0, 0.0, 1e-6 * np.eye(shape.size))
    gain = Improvement(trials[len(trials) // 2].name, 0.3, 0.2, 0.1, 0.09, 0.01, (0.2, 0.4))
    nothing = Remainder(0.0, 0.0)
    band, unseen = compared_band(model, trials[0].rate), lines[len(lines) // 2]
    details = StructureDetails(fitted, fitted, lines, lines, (hypothesis, hypothesis), unseen, band)
    return Diagnosis("structure", "none", (), (), (), gain, nothing, nothing, {}, details)
