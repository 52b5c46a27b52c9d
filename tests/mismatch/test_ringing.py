"""Derivatives of the lines of ringing recordings: against central differences, for two modes and mixed quantities."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Channel
from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, library, predict_lines
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.hypothesis import predicted_from
from millfrf.mismatch.models.linear_lines import linear_lines
from millfrf.mismatch.models.misfit import jacobian, slopes
from modal_fit import ModalModel

RATE, SECONDS = 64.0, 12.0
POLES = 2 * np.pi * np.array([3.0, 7.0]) * (-0.004 + 1j)
RIGHT = np.array([[1.0, 0.6 + 0.1j], [-0.5, 1.0 + 0.2j]])
LEFT = np.array([[0.9, 0.5], [-0.4, 1.1]]) / (2j * POLES.imag[:, None] * 20.0)
PLACES = ("TCP:+X", "TCP:+Y")


def channel(name: str, quantity: str, unit: str) -> Channel:
    return Channel(name, quantity, unit, "TCP", f"+{name[-1].upper()}")


def ringing(quantities: tuple[str, str], band: tuple[float, float] | None) -> tuple[Hypothesis, WindowedSpectrum]:
    """A hypothesis away from its nominal model, and a recording of it in which both modes ring."""
    units = {"displacement": "m", "acceleration": "m/s^2"}
    model = ModalModel(POLES, RIGHT, LEFT, PLACES, PLACES, band=band)
    rng = np.random.default_rng(4)
    responses = tuple(channel(f"r{axis}", name, units[name]) for axis, name in zip("xy", quantities, strict=True))
    forces = tuple(channel(f"f{axis}", "force", "N") for axis in "xy")
    count = int(SECONDS * RATE)
    recording = BandRecording(
        "part", RATE, rng.standard_normal((count, 2)), 1e-3 * rng.standard_normal((count, 2)), forces, responses
    )
    shape = ModelShape(model, LabError())
    lines = windowed_spectrum(recording, (1.0, 12.0), -float(POLES.real.max()), first_motion=True)
    return Hypothesis(shape, 0.3 * rng.standard_normal(shape.size)), lines


@pytest.mark.parametrize("band", [None, (1.0, 12.0)])
@pytest.mark.parametrize("quantities", [("acceleration", "acceleration"), ("displacement", "acceleration")])
def test_derivatives_are_those_of_the_prediction(quantities: tuple[str, str], band: tuple[float, float] | None) -> None:
    hypothesis, lines = ringing(quantities, band)
    assert lines.rings(POLES).all()
    predicted = predict_lines(hypothesis, lines)
    derivatives = jacobian(hypothesis, lines, predicted)
    # what a first motion takes up is no error of a derivative, as the response is noise that it follows in part
    basis = predicted.taken_up_by_first_motion
    size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))
    for number in range(hypothesis.size):
        aside = 1e-3 * np.eye(hypothesis.size)[number]
        above, below = (predict_lines(replace(hypothesis, u=hypothesis.u + sign * aside), lines) for sign in (1, -1))
        difference = (above.response - below.response) / 2e-3 - derivatives[:, :, number]
        relative = (difference / size).ravel()
        rows = np.concatenate([relative.real, relative.imag])
        rest = rows - basis @ (basis.T @ rows)
        assert np.linalg.norm(rest) < 1e-4 * max(np.linalg.norm(derivatives[:, :, number] / size), 1e-3)


@pytest.mark.parametrize("law", [None, "stiffness_hardening"])
def test_signals_of_modes_and_joints_give_the_derivative_of_whole_spectra(law: str | None) -> None:
    hypothesis, lines = ringing(("displacement", "acceleration"), (1.0, 12.0))
    if law is not None:
        physics = library()[law]
        assert isinstance(physics, JointPhysics)
        motion = JointMotion(1e-3, 0.02, 5e-3, 0.1, 7e3)
        axis = JointAxis(np.array([0.8, 0.6]))
        hypothesis = hypothesis.with_cause(Cause(physics, np.array([1e7, 3.0]), "", axis, motion))
    predicted = predict_lines(hypothesis, lines)
    whole = lines.whole()
    real, imaginary = slopes(hypothesis, whole, predicted, linear_lines(hypothesis, whole)).of(slice(None))
    flat = (real + 1j * imaginary).reshape(len(whole.frequencies), -1)
    held = lines.cut(lines.signal(flat)).reshape(*lines.measured.shape, -1)
    size = np.sqrt(np.mean(np.abs(lines.measured) ** 2, axis=0))[:, None]
    rows = np.concatenate([(held / size).real, (held / size).imag]).reshape(-1, hypothesis.size)
    basis = predicted.taken_up_by_first_motion
    rows -= basis @ (basis.T @ rows)
    expected = rows.reshape(2, *held.shape)
    derivatives = jacobian(hypothesis, lines, predicted) / size
    tolerance = 1e-9 if law is None else 1e-6  # changes of joint forces are in single precision
    np.testing.assert_allclose(derivatives, expected[0] + 1j * expected[1], atol=tolerance * np.abs(expected).max())


def test_a_first_motion_under_friction_has_the_least_misfit() -> None:
    """The numbers of the first motion of a joint with friction: none of them lowers the misfit any further."""
    hypothesis, lines = ringing(("displacement", "displacement"), None)
    friction = library()["coulomb_friction"]
    assert isinstance(friction, JointPhysics)
    axis = JointAxis(np.array([0.8, 0.6]))
    law = Cause(friction, np.array([0.15, 2e-3]), "", axis, JointMotion(1e-3, 0.02, 5e-3, 0.1, 7e3))
    hypothesis = hypothesis.with_cause(law)
    moving = np.array([2e-2 + 1e-2j, 1e-2j])
    begun = predicted_from(hypothesis, lines, moving)
    lines = replace(lines, measured=begun.response)
    predicted = predict_lines(hypothesis, lines)
    rest = np.linalg.norm(predicted_from(hypothesis, lines).response - lines.measured)
    assert np.linalg.norm(predicted.response - lines.measured) < 1e-3 * rest
    assert predicted.first is not None
    np.testing.assert_allclose(predicted.first, moving, rtol=1e-3, atol=2e-5)
