"""A fit that began with the wrong sign of a mode's part finds the right one; a right one stays as it is."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, fit, library, predict_lines
from millfrf.mismatch.joints.joint_axis import JointAxis, modal_scales
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.joint_starts import with_flipped_signs
from modal_fit import ModalModel

TrialOf = Callable[[ModalModel, str, float, int], BandRecording]
LEAST = 20.0
PARTS = np.array([0.5, 0.7, -0.5])


@pytest.fixture(scope="module")
def armed() -> ModalModel:
    """Three modes, driven at the tip and seen there and on the arm."""
    omega, zeta = 2 * np.pi * np.array([6.0, 10.0, 15.0]), np.array([0.02, 0.015, 0.015])
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    shapes = np.array([[1.0, 0.4, 0.5, -0.2], [0.7, 0.6, -0.8, -0.6], [0.6, -0.8, 0.7, -0.9]])
    right = shapes / (2j * poles.imag[:, None] * 40.0)
    return ModalModel(
        poles, right, shapes[:, :2].astype(complex), ("TCP:+X", "TCP:+Y", "WING:+X", "ARM:+X"), ("TCP:+X", "TCP:+Y")
    )


def _law(model: ModalModel, entries: np.ndarray) -> Cause:
    """A hardening joint in which the modes take part as they are given."""
    physics, motion = library()["stiffness_hardening"], JointMotion(1e-3, 0.06, 1e-2, 0.6, 5e4)
    assert isinstance(physics, JointPhysics)
    values = physics.starts(motion)[0].copy()
    values[0] = 0.4 * motion.stiffness * motion.deflection
    return Cause(physics, values, "", JointAxis(entries / np.linalg.norm(entries), modal_scales(model)), motion)


@pytest.fixture(scope="module")
def recorded(armed: ModalModel, trial_of: TrialOf) -> list[WindowedSpectrum]:
    """Recordings at two levels, with 1 % noise."""
    shape, rng, result = ModelShape(armed, LabError()), np.random.default_rng(5), []
    driven = replace(armed, right=armed.right[:, :2], responses=armed.responses[:2])
    for number, level in enumerate((20.0, 60.0)):
        trial = trial_of(driven, f"level {number}", level, number)
        motions = channels_of("acceleration", armed.responses, ("ax", "ay", "wing", "arm"))
        force = replace(trial, response=np.zeros((len(trial.force), 4)), responses=motions)
        lines = windowed_spectrum(force, band_of(armed, 128.0), 4.0)
        right = Hypothesis(shape, np.zeros(shape.size), (_law(armed, PARTS),))
        made = lines.signal(predict_lines(right, lines).spectrum)[: len(force.response)]
        noisy = made + 0.01 * made.std(axis=0) * rng.normal(size=made.shape)
        result.append(windowed_spectrum(replace(force, response=noisy), band_of(armed, 128.0), 4.0))
    return result


def _fitted(armed: ModalModel, lines: list[WindowedSpectrum], entries: np.ndarray) -> Fit:
    shape = ModelShape(armed, LabError())
    return fit(lines, Hypothesis(shape, np.zeros(shape.size), (_law(armed, entries),)), iterations=20)


def _parts(found: Fit) -> np.ndarray:
    axis = found.hypothesis.causes[-1].axis
    assert axis is not None
    return axis.entries * np.sign(axis.entries[0])


@pytest.mark.long
@pytest.mark.parametrize("signs", [(1, -1, 1), (-1, 1, 1)])
def test_a_fit_that_stopped_on_a_wrong_sign_is_led_to_the_right_ones(
    armed: ModalModel, recorded: list[WindowedSpectrum], signs: tuple[int, int, int]
) -> None:
    right, begun = (_fitted(armed, recorded, parts) for parts in (PARTS, PARTS * signs))
    assert begun.score > right.score + 1000  # twenty steps do not lead out of the valley
    corrected = with_flipped_signs(recorded, begun, LEAST)
    assert corrected.score < right.score + LEAST
    np.testing.assert_allclose(_parts(corrected), PARTS / np.linalg.norm(PARTS), atol=0.02)


def test_right_signs_stay(armed: ModalModel, recorded: list[WindowedSpectrum]) -> None:
    begun = _fitted(armed, recorded, PARTS)
    assert with_flipped_signs(recorded, begun, LEAST) is begun


def test_a_direction_at_the_tip_has_no_signs_to_turn(armed: ModalModel, recorded: list[WindowedSpectrum]) -> None:
    begun = _fitted(armed, recorded, PARTS)
    hypothesis = begun.hypothesis
    at_tip = replace(hypothesis.causes[-1], axis=JointAxis(np.array([0.6, 0.8])))
    tip = replace(begun, hypothesis=replace(hypothesis, causes=(at_tip,)))
    assert with_flipped_signs(recorded, tip, LEAST) is tip
