"""Joints that act on one structure at once: closed forms, an integration of its own, and derivatives."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from two_link_arm import DAMPING, MASS, STIFFNESS, arm_model, arm_recording, integrated, torques

from estimation import BandRecording, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, library, predict_lines
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import POINTS, JointLaw, JointMotion, joint_responses
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.misfit import jacobian
from millfrf.mismatch.records.reading import band_of
from modal_fit import ModalModel

RATE, SECONDS = 100.0, 10.0


def _frictions(physics: str, forces: tuple[float, float]) -> tuple[Cause, ...]:
    law, motion = library()[physics], JointMotion(0.3, 1.5, 3.0, 15.0, 1.0)
    assert isinstance(law, JointPhysics)
    axes = (JointAxis(np.array([1.0, 0.0])), JointAxis(np.array([0.0, 1.0])))
    return tuple(
        Cause(law, np.array([force, *law.starts(motion)[0][1:]]), "", axis, motion)
        for force, axis in zip(forces, axes, strict=True)
    )


def _arm_recording(friction: tuple[float, float]) -> BandRecording:
    """A second of rest, then torques; the motion by an integration of its own."""
    torque = torques(RATE, SECONDS)
    angles = integrated(torque, RATE, friction)
    rest = np.zeros((int(RATE), 2))
    return arm_recording("run", RATE, np.vstack([rest, torque]), np.vstack([rest, angles]))


@pytest.mark.parametrize("friction", [(0.0, 0.0), (0.1, 0.0), (0.15, 0.1)])
def test_friction_in_two_joints_moves_an_arm_as_an_integration_of_its_own(friction: tuple[float, float]) -> None:
    """One joint after the other, as if the later ones did not exist, left up to 36 % of the motion."""
    recording = _arm_recording(friction)
    model = arm_model()
    lines = windowed_spectrum(recording, (0.3, 10.0), float(-model.poles.real.max()))
    shape = ModelShape(model, LabError())
    causes = tuple(cause for cause in _frictions("coulomb_friction", friction) if cause.values[0] > 0)
    for order in (causes, causes[::-1]):
        predicted = predict_lines(Hypothesis(shape, np.zeros(shape.size), order), lines).response
        assert np.linalg.norm(predicted - lines.measured) < 0.03 * np.linalg.norm(lines.measured)


@pytest.mark.parametrize("kind", ["spring", "damper"])
def test_linear_joints_are_their_closed_form(kind: str) -> None:
    """``G = K (I + H K)^-1 x_free``, with K a stiffness or i w times a damping in each joint."""
    model = arm_model()
    lines = windowed_spectrum(_arm_recording((0.0, 0.0)), (0.3, 10.0), float(-model.poles.real.max()))
    s = 2j * np.pi * lines.padded_frequencies
    strengths = np.array([1.5, 0.8]) if kind == "spring" else np.array([0.2, 0.1])
    ends = np.linspace(-1, 1, POINTS)
    laws = [
        JointLaw(reach=5.0, stiffness=5 * k * ends) if kind == "spring" else JointLaw(speed=50.0, damping=50 * k * ends)
        for k in strengths
    ]
    receptance = model.receptance(lines.padded_frequencies)
    free = np.einsum("kpq,kq->kp", receptance, lines.force_lines)
    ways = [(np.eye(2)[k], np.eye(2)[k]) for k in range(2)]
    forces = np.stack([each.force for each in joint_responses(model, lines, free, ways, laws)], axis=1)
    factors = np.diag(strengths) * (np.ones(len(s)) if kind == "spring" else s)[:, None, None]
    expected = np.linalg.solve(np.eye(2) + factors @ receptance, factors @ free[:, :, None])[:, :, 0]
    # after the recording the forces fade out
    during, due = lines.signal(forces), lines.signal(expected)
    assert np.abs(during - due).max() < 0.01 * np.abs(due).max()


@pytest.mark.parametrize("name", ["coulomb_friction", "stiffness_hardening"])
def test_derivatives_of_two_joints_are_those_of_whole_simulations(
    small_model: ModalModel, trial_of: Callable[[ModalModel, str, float, int], BandRecording], name: str
) -> None:
    """By frequency, damping, the numbers of both laws and both angles, with joints of equal strength."""
    omega = np.abs(small_model.poles)
    damped = replace(small_model, poles=omega * (-0.1 + 1j * np.sqrt(1 - 0.01)))
    lines = windowed_spectrum(trial_of(damped, "mid", 50.0, 4), band_of(damped, 128.0), 4.0)
    shape, law = ModelShape(damped, LabError()), library()[name]
    motion = JointMotion(1e-4, 1e-2, 1e-3, 0.1, 2e5)
    causes = []
    for axis in np.eye(2):
        values = law.starts(motion)[0].copy()
        values[0] = {"coulomb_friction": 5.0, "stiffness_hardening": values[0]}[name]
        causes.append(Cause(law, values, "", JointAxis(axis), motion))
    hypothesis = Hypothesis(shape, np.zeros(shape.size), tuple(causes))
    slope = jacobian(hypothesis, lines, predict_lines(hypothesis, lines))
    size, h = shape.size, 0.03

    def moved(k: int, by: float) -> np.ndarray:
        if k < size:
            return predict_lines(replace(hypothesis, u=by * np.eye(size)[k]), lines).response
        coordinates = hypothesis.coordinates()
        coordinates[k - size] += by
        return predict_lines(hypothesis.with_causes(coordinates), lines).response

    for k in [0, 1, *range(size, hypothesis.size)]:
        quotient = (moved(k, h) - moved(k, -h)) / (2 * h)
        assert np.linalg.norm(slope[:, :, k] - quotient) < 0.2 * np.linalg.norm(quotient), k


def test_the_arm_is_what_its_model_says() -> None:
    """The modal model of the tests is the inverse of the dynamic stiffness."""
    frequencies = np.array([0.5, 1.0, 2.0])
    s = 2j * np.pi * frequencies[:, None, None]
    dynamic = STIFFNESS + s * DAMPING * np.eye(2) + s**2 * MASS
    np.testing.assert_allclose(arm_model().receptance(frequencies), np.linalg.inv(dynamic), rtol=1e-9)
