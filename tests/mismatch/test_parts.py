"""The diagnosis' parts: derivatives, noise, time loop, library."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointLaw, LabError, ModelShape
from millfrf.mismatch.joints.joint_law import POINTS, driven_force, joint_responses
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.modal_lines import receptance_at
from millfrf.mismatch.physics import library as physics_folder
from millfrf.mismatch.records.noise_model import fit_noise, whitening
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.reported_causes import accepted_cause
from modal_fit import ModalModel, Residuals


@pytest.fixture(scope="module")
def lines(model: ModalModel, linear_trials: list[BandRecording]) -> WindowedSpectrum:
    return windowed_spectrum(linear_trials[1], band_of(model, 256.0), float((-model.poles.real).min()))


def test_derivatives_of_the_modal_model_are_those_of_finite_differences(model: ModalModel) -> None:
    shape = ModelShape(model, LabError())
    rng = np.random.default_rng(0)
    u, frequencies = rng.normal(size=shape.size), np.linspace(3, 40, 25)
    force = rng.normal(size=(25, 2)) + 1j * rng.normal(size=(25, 2))
    slope = shape.jacobian(u, frequencies, force)
    for k in range(shape.size):
        aside = np.zeros(shape.size)
        aside[k] = 1e-5
        two = [np.einsum("kpq,kq->kp", shape.model(v).receptance(frequencies), force) for v in (u + aside, u - aside)]
        expected = (two[0] - two[1]) / 2e-5
        np.testing.assert_allclose(slope[:, :, k], expected, atol=1e-6 * np.abs(expected).max() + 1e-14)


def test_a_linear_recording_is_predicted_down_to_its_noise(model: ModalModel, lines: WindowedSpectrum) -> None:
    rest = lines.measured - lines.from_force(receptance_at(model, lines.padded_frequencies), lines.force_lines)
    share = np.sqrt(np.sum(np.abs(rest) ** 2) / np.sum(np.abs(lines.measured) ** 2))
    assert share < 0.02


@pytest.mark.parametrize("colour", [0.0, 1.0])
def test_noise_of_responses_and_forces_is_told_apart(model: ModalModel, lines: WindowedSpectrum, colour: float) -> None:
    """Variances known, coloured as 1 / f^colour: recovered within a fifth where they matter."""
    rng = np.random.default_rng(1)
    frequencies = np.linspace(3, 40, 4000)
    through = model.receptance(frequencies) * (2j * np.pi * frequencies[:, None, None]) ** 2
    own = (frequencies / 10) ** -colour
    force_variance = np.array([40.0, 90.0])

    def draw(n: int) -> np.ndarray:
        return (rng.normal(size=(4000, n)) + 1j * rng.normal(size=(4000, n))) / np.sqrt(2)

    rest = draw(2) * np.sqrt(own)[:, None] + np.einsum("kpq,kq->kp", through, draw(2) * np.sqrt(force_variance))
    result = fit_noise(frequencies, rest, through, (np.full(2, 50.0), np.full(2, 300.0)))
    np.testing.assert_allclose(np.exp(result.forces), force_variance, rtol=0.2)
    middle = (frequencies > 5) & (frequencies < 35)
    covariance = result.covariance(frequencies, 0 * through)[middle]
    np.testing.assert_allclose(np.real(covariance[:, 0, 0]), own[middle], rtol=0.35)
    white = np.einsum("kij,kj->ki", whitening(result.covariance(frequencies, through)), rest)
    assert np.mean(np.abs(white) ** 2) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kind", ["spring", "damper", "elements"])
def test_free_simulation_of_a_linear_joint_is_its_closed_form(
    model: ModalModel, lines: WindowedSpectrum, kind: str
) -> None:
    """A spring, a damper, and elastic elements that never yield: ``g = k x_free / (1 + k h)``."""
    s = 2j * np.pi * lines.padded_frequencies
    direction = np.array([0.6, 0.8])
    k = 2e4
    law = {
        "spring": JointLaw(reach=0.1, stiffness=k * np.linspace(-0.1, 0.1, POINTS)),
        "damper": JointLaw(speed=5.0, damping=400 * np.linspace(-5, 5, POINTS)),
        "elements": JointLaw(springs=np.array([k / 4, 3 * k / 4]), yields=np.array([1.0, 2.0])),
    }[kind]
    receptance = receptance_at(model, lines.padded_frequencies)
    free = np.einsum("p,kpq,kq->k", direction, receptance, lines.force_lines)
    simulated = joint_responses(model, lines, free[:, None], [(direction, direction)], [law])[0].force
    own = np.einsum("p,kpq,q->k", direction, receptance, direction)
    factor = 400 * s if kind == "damper" else k
    expected = factor * free / (1 + factor * own)
    # after the recording the force fades out
    during, due = (lines.signal(each[:, None]) for each in (simulated, expected))
    assert np.abs(during - due).max() < 2e-3 * np.abs(due).max()


def test_an_elastic_plastic_element_follows_its_loop(lines: WindowedSpectrum) -> None:
    """Up to the yield, down to the other: the corners of Iwan's parallelogram."""
    x = np.concatenate([np.linspace(0, 3, 60), np.linspace(3, -3, 120), np.linspace(-3, 0, 60)])
    force = driven_force(lines, x, 0 * x, JointLaw(springs=np.array([10.0]), yields=np.array([1.0])))
    assert force[59] == pytest.approx(10.0)
    assert force[0] == 0
    assert force[179] == pytest.approx(-10.0)
    assert force[60:110].min() == pytest.approx(-10.0)
    assert force[62] == pytest.approx(10 - 10 * (3 - x[62]), abs=1e-9)


def test_every_cause_states_its_equation_and_source() -> None:
    for cause in physics_folder.library().values():
        assert cause.equation
        assert cause.source
        assert all(other in physics_folder.library() or other == "modal_parameters" for other in cause.confusable_with)


TOY = """
import numpy as np
from millfrf.mismatch import JointLaw
from millfrf.mismatch import Parameter


class Toy:
    name = "toy_square_root"
    equation = "g = c sign(v) sqrt|v|"
    source = "this test"
    parameters = (Parameter("c", "", 0.1, 0.0, 1e9, logarithmic=True),)
    confusable_with = ()

    def starts(self, motion):
        return (np.array([1.0]),)

    def law(self, values, motion):
        v = motion.velocities
        return JointLaw(speed=motion.speed, damping=values[0] * np.sign(v) * np.sqrt(np.abs(v)))


PHYSICS = Toy()
"""


def test_a_new_cause_is_one_entry_of_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    defined: dict[str, Any] = {}
    exec(TOY, defined)
    monkeypatch.setattr(physics_folder, "CAUSES", (*physics_folder.CAUSES, defined["PHYSICS"]))
    toy = physics_folder.library()["toy_square_root"]
    assert isinstance(toy, physics_folder.JointPhysics)


def test_explanation_without_causes_is_the_nominal_model(model: ModalModel) -> None:
    shape = ModelShape(model, LabError())
    same = Hypothesis(shape, np.zeros(shape.size)).model
    np.testing.assert_allclose(same.poles, model.poles)
    np.testing.assert_allclose(same.right, replace(model).right)


def test_a_residual_inertia_says_nothing_below_the_band(model: ModalModel) -> None:
    """Above a third of the lowest mode it is the model's own; below it, and at 0 Hz, the modes alone remain."""
    heavy = replace(model, residuals=Residuals(upper=np.zeros((2, 2)), lower=-0.01 * np.eye(2)))
    frequencies = np.array([0.0, 0.5, 2.9, 3.1, 9.0, 20.0])
    result = receptance_at(heavy, frequencies)
    np.testing.assert_allclose(result[:3], model.receptance(frequencies[:3]), rtol=1e-12)
    np.testing.assert_allclose(result[3:], heavy.receptance(frequencies[3:]), rtol=1e-12)


def test_numbers_a_laboratory_knows_better_with_their_errors(model: ModalModel) -> None:
    """Resonance and damping ratio of a dynamometer, and errors by hand: df/f = dT2 / (2 T2)."""
    shape = ModelShape(model, LabError())
    physics = physics_folder.library()["dynamometer_dynamics"]
    squared, damping = 4e-6, 1e-4
    cause = Cause(physics, np.array([squared, damping]), "")
    hypothesis = Hypothesis(shape, np.zeros(shape.size), (cause,))
    covariance = np.zeros((hypothesis.size, hypothesis.size))
    covariance[-2, -2], covariance[-1, -1] = 0.25, 4.0
    fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, covariance)
    result = accepted_cause(fitted, {}, 1.0)
    frequency, ratio = 1 / (2 * np.pi * np.sqrt(squared)), damping / (2 * np.sqrt(squared))
    spread, other = result.standard_errors["squared_period_s2"], result.standard_errors["damping_time_s"]
    assert result.parameters["resonance_hz"] == pytest.approx(frequency)
    assert result.parameters["damping_ratio"] == pytest.approx(ratio)
    assert result.standard_errors["resonance_hz"] == pytest.approx(frequency * spread / (2 * squared), rel=1e-4)
    expected = ratio * np.hypot(spread / (2 * squared), other / damping)
    assert result.standard_errors["damping_ratio"] == pytest.approx(expected, rel=1e-4)
