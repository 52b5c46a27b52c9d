"""Where a joint is sought: the tip is taken where it says all, parts of the modes where it does not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum
from millfrf.mismatch import (
    Hypothesis,
    JointPhysics,
    LabError,
    ModelShape,
    fit,
    joint_in_words,
    library,
    linear_floor,
    predict_lines,
)
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.inference.settings import EvidenceSettings, ScreeningSettings
from millfrf.mismatch.joints.joint_axis import JointAxis, modal_scales
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause, location_of
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.joint_places import JointPlace, joint_places
from millfrf.mismatch.screening.joint_starts import started_at
from millfrf.mismatch.structure.acceptance import impossible
from modal_fit import ModalModel

TrialOf = Callable[[ModalModel, str, float, int], BandRecording]
MARGIN = ScreeningSettings().place


@pytest.fixture(scope="module")
def armed() -> ModalModel:
    """Three modes of a structure driven at its tip in X and Y, and seen there and at two points of its arm."""
    omega, zeta = 2 * np.pi * np.array([6.0, 10.0, 14.0]), np.array([0.03, 0.02, 0.02])
    poles = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    shapes = np.array([[1.0, 0.4, 0.5, -0.2], [-0.3, 0.9, 0.3, -0.5], [0.6, -0.8, -0.3, -0.9]])
    return ModalModel(
        poles,
        shapes / (2j * poles.imag[:, None] * 40.0),
        shapes[:, :2].astype(complex),
        ("TCP:+X", "TCP:+Y", "WING:+X", "PAYLOAD:+X"),
        ("TCP:+X", "TCP:+Y"),
    )


def _between(model: ModalModel) -> JointAxis:
    """Between wing and payload."""
    scales = modal_scales(model)
    parts = np.real((model.right[:, 2] - model.right[:, 3]) / scales.seen)
    return JointAxis(parts / np.linalg.norm(parts), scales)


def _trial(model: ModalModel, axis: JointAxis, driven: BandRecording, rng: np.random.Generator) -> WindowedSpectrum:
    """A recording of the structure with a hardening joint under the forces of another, with 1 % noise."""
    motions = channels_of("acceleration", model.responses, ("ax", "ay", "wing", "payload"))
    force = replace(driven, response=np.zeros((len(driven.force), 4)), responses=motions)
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, 5e4)
    physics = library()["stiffness_hardening"]
    assert isinstance(physics, JointPhysics)
    values = physics.starts(motion)[0].copy()
    values[0] = 0.4 * motion.stiffness * motion.deflection
    shape = ModelShape(model, LabError())
    hypothesis = Hypothesis(shape, np.zeros(shape.size), (Cause(physics, values, "", axis, motion),))
    lines = windowed_spectrum(force, band_of(model, 128.0), 4.0)
    made = lines.signal(predict_lines(hypothesis, lines).spectrum)[: len(force.response)]
    noisy = made + 0.01 * made.std(axis=0) * rng.normal(size=made.shape)
    return windowed_spectrum(replace(force, response=noisy), band_of(model, 128.0), 4.0)


def _refitted(model: ModalModel, axis: JointAxis, trial_of: TrialOf) -> tuple[list[WindowedSpectrum], Fit]:
    """Two recordings of the structure with a joint along an axis, and the linear refit of both."""
    rng = np.random.default_rng(3)
    driven = replace(model, right=model.right[:, :2], responses=model.responses[:2])
    trials = [trial_of(driven, name, level, k) for k, (name, level) in enumerate((("low", 20.0), ("high", 60.0)))]
    lines = [_trial(model, axis, each, rng) for each in trials]
    shape = ModelShape(model, LabError())
    return lines, fit(lines, Hypothesis(shape, np.zeros(shape.size)))


def _places(model: ModalModel, axis: JointAxis, trial_of: TrialOf) -> tuple[JointPlace, ...]:
    lines, base = _refitted(model, axis, trial_of)
    return joint_places(linear_floor(base, lines), base.hypothesis, MARGIN)


def test_a_law_that_begins_where_the_joint_is_gains_most(armed: ModalModel, trial_of: TrialOf) -> None:
    lines, base = _refitted(armed, _between(armed), trial_of)
    law, softer = library()["stiffness_hardening"], library()["stiffness_softening"]
    assert isinstance(law, JointPhysics)
    assert isinstance(softer, JointPhysics)
    there = started_at(lines, base, law, _between(armed))
    elsewhere = started_at(lines, base, law, JointAxis(np.array([0.0, 1.0])))
    assert there is not None
    assert there.score < base.score - 1000
    assert there.hypothesis.causes[-1].seen is None
    assert elsewhere is None or there.score < elsewhere.score - 100
    assert started_at(lines, base, softer, _between(armed)) is None  # of the wrong sign


def test_a_joint_between_two_points_is_found_there(armed: ModalModel, trial_of: TrialOf) -> None:
    result = _places(armed, _between(armed), trial_of)
    assert result[0].name == "between WING and PAYLOAD along X"
    np.testing.assert_allclose(np.abs(result[0].axis.entries), np.abs(_between(armed).entries), atol=0.1)
    assert "at the tip" not in [each.name for each in result]


def test_a_joint_at_the_tip_is_found_there(armed: ModalModel, trial_of: TrialOf) -> None:
    """The modes' parts are as many-sided, and are not taken for that."""
    direction = np.array([0.8, 0.6])
    result = _places(armed, JointAxis(direction), trial_of)
    assert result[0].name == "at the tip"
    assert abs(result[0].axis.entries @ direction) > 0.99


def test_parts_of_modes_are_told(armed: ModalModel) -> None:
    location = location_of(_between(armed), armed)
    assert [each["mode_hz"] for each in location["participation"]] == [6.0, 10.0, 14.0]
    assert max(each["part"] for each in location["participation"]) > 0.5
    assert joint_in_words(location).startswith("away from the tip: the mode at ")


def test_a_law_that_asks_for_another_structure_is_impossible(armed: ModalModel) -> None:
    """Modes that lie elsewhere bend to any law: beyond fifty errors of a laboratory the law explains nothing."""
    shape, settings = ModelShape(armed, LabError()), EvidenceSettings()
    physics = library()["backlash"]
    assert isinstance(physics, JointPhysics)
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, 5e4)
    cause = Cause(physics, physics.starts(motion)[0], "", _between(armed), motion)
    for off, said in ((20.0, ""), (70.0, "the mode at 14 Hz would have to lie at 28.19 Hz")):
        u = np.zeros(shape.size)
        u[2 * shape.per_mode] = off
        hypothesis = Hypothesis(shape, u, (cause,))
        fitted = Fit(hypothesis, (), 0.0, 0.0, 0.0, np.eye(hypothesis.size))
        assert impossible(Proposal("backlash", {}, fitted, 100.0), settings) == said
