"""A joint inside a structure whose damping is not proportional: the modes' parts in it have phases.

The truth is three masses in a chain, integrated in time by Runge-Kutta from mass, damping and stiffness. It knows
nothing of modes or laws of the tool.
"""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eig
from scipy.signal import resample

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum
from millfrf.mismatch import (
    Hypothesis,
    JointPhysics,
    LabError,
    ModelShape,
    fit,
    improved_model,
    joint_in_words,
    library,
    predict_lines,
)
from millfrf.mismatch.joints.joint_axis import JointAxis, axis_over_modes, modal_scales
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause, location_of
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.model_terms import hypothesis_of
from millfrf.mismatch.physics.linear_causes import MISSING_MODE
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.joint_starts import moved_away_from_tip, phases_too_large, with_phases
from modal_fit import ModalModel

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

RATE, FINE, LEAST = 256.0, 8, 20.0
MASSES = np.diag([6.0, 5.0, 4.0])
STIFFNESS = 3e4 * np.array([[2.2, -1.0, 0.0], [-1.0, 1.7, -0.7], [0.0, -0.7, 0.9]])
DAMPING = 1e-4 * STIFFNESS + np.diag([250.0, 0.0, 0.0])
"""Proportional but for a damper between the first mass and ground."""

JOINT = np.array([1.0, -1.0, 0.0])
"""The joint lies between the first and the second mass; the force acts on the third."""

NEAR_TIP = np.array([0.0, -0.4, 1.0])
"""A joint that moves nearly as the third mass does."""

CUBIC = 4e10


def _modes() -> tuple[Complex, Complex, Complex]:
    """Poles, shapes (n_modes, 3) and their modal constants, of the linear chain."""
    inverse = np.linalg.inv(MASSES)
    matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ STIFFNESS, -inverse @ DAMPING]])
    poles, vectors = eig(matrix)
    up = np.flatnonzero(poles.imag > 0)
    up = up[np.argsort(np.abs(poles[up]))]
    shapes = vectors[:3, up].T
    constants = [phi @ (2 * p * MASSES + DAMPING) @ phi for p, phi in zip(poles[up], shapes, strict=True)]
    return poles[up], shapes, np.array(constants)


@pytest.fixture(scope="module")
def chain() -> ModalModel:
    """The linear chain, driven and seen at the third mass and seen at the second."""
    poles, shapes, constants = _modes()
    right, left = (shapes / constants[:, None])[:, [2, 1]], shapes[:, 2:]
    return ModalModel(poles, right, left, ("TCP:+X", "ARM:+X"), ("TCP:+X",))


def _acceleration(force: Real, joint: Real) -> Real:
    """Accelerations (n, 3) of the chain with a cubic joint, by Runge-Kutta, without what lies above the recording."""
    step, inverse = 1 / (RATE * FINE), np.linalg.inv(MASSES)
    fine = np.append(resample(force, len(force) * FINE), 0.0)

    def slope(state: Real, push: float) -> Real:
        x, v = state[:3], state[3:]
        inner = DAMPING @ v + STIFFNESS @ x + joint * CUBIC * (joint @ x) ** 3
        return np.concatenate([v, inverse @ (np.array([0.0, 0.0, push]) - inner)])

    state, shown = np.zeros(6), np.empty((len(fine) - 1, 3))
    for k, (early, late) in enumerate(pairwise(fine)):
        single = slope(state, early)
        shown[k] = single[3:]
        two = slope(state + step / 2 * single, (early + late) / 2)
        three = slope(state + step / 2 * two, (early + late) / 2)
        state = state + step / 6 * (single + 2 * two + 2 * three + slope(state + step * three, late))
    return np.asarray(resample(shown, len(force)))


def _recorded(model: ModalModel, level: float, seed: int, joint: Real) -> WindowedSpectrum:
    """One recording of the chain under a smooth random force, 1 % noise."""
    rng = np.random.default_rng(seed)
    n = int(24 * RATE)
    spectrum = np.fft.rfft(rng.normal(size=n))
    spectrum[np.fft.rfftfreq(n, 1 / RATE) > 24] = 0
    force = level * np.fft.irfft(spectrum, n)
    response = _acceleration(force, joint)[:, [2, 1]]
    response += 0.01 * response.std(axis=0) * rng.normal(size=response.shape)
    motions = channels_of("acceleration", model.responses, ("ax", "arm"))
    forces = channels_of("force", model.excitations, ("fx",))
    recording = BandRecording(f"level {level:g}", RATE, force[:, None], response, forces, motions)
    return windowed_spectrum(recording, band_of(model, RATE), 2.0)


@pytest.fixture(scope="module")
def recorded(chain: ModalModel) -> list[WindowedSpectrum]:
    return [_recorded(chain, level, seed, JOINT) for seed, level in enumerate((60.0, 150.0))]


def _true_parts(model: ModalModel) -> Complex:
    """Part of each mode in the joint, from the shapes of the chain, in the scales of the model."""
    _, shapes, constants = _modes()
    scales = modal_scales(model)
    seen, pushed = shapes @ JOINT / constants / scales.seen, shapes @ JOINT / scales.pushed
    np.testing.assert_allclose(seen, pushed, rtol=1e-9)
    return np.asarray(seen / np.linalg.norm(seen))


def _begun(model: ModalModel, axis: JointAxis) -> Hypothesis:
    motion = JointMotion(4e-4, 0.02, 4e-3, 0.3, 5e4)
    physics = library()["stiffness_hardening"]
    assert isinstance(physics, JointPhysics)
    values = physics.starts(motion)[0].copy()
    shape = ModelShape(model, LabError())
    return Hypothesis(shape, np.zeros(shape.size), (Cause(physics, values, "", axis, motion),))


@pytest.fixture(scope="module")
def real_parts(chain: ModalModel, recorded: list[WindowedSpectrum]) -> Fit:
    """The law with parts that have no phases."""
    parts = _true_parts(chain).real
    return fit(recorded, _begun(chain, JointAxis(parts / np.linalg.norm(parts), modal_scales(chain))), iterations=30)


def _parts(fitted: Fit) -> Complex:
    axis = fitted.hypothesis.causes[-1].axis
    assert axis is not None
    return axis.participations(3)


def test_phases_are_found_where_damping_is_not_proportional(
    chain: ModalModel, recorded: list[WindowedSpectrum], real_parts: Fit
) -> None:
    """The parts are those of the chain's own shapes, and what is left is the noise."""
    phased = with_phases(recorded, real_parts, LEAST)
    assert phased.score < real_parts.score - 100
    result, true = _parts(phased), _true_parts(chain)
    assert np.abs(true.imag).max() > 0.1
    np.testing.assert_allclose(result * np.sign((result @ true.conj()).real), true, atol=0.03)
    first, settled = recorded[-1], fit(recorded, phased.hypothesis, phased.noises, iterations=20)
    rest = first.measured - predict_lines(settled.hypothesis, first).response
    noise = 0.01 * first.recording.response.std(axis=0)
    assert settled.hypothesis.causes[-1].values[1] == pytest.approx(3.0, abs=0.03)
    assert (np.sqrt(np.mean(np.abs(rest) ** 2, axis=0)) < 1.15 * noise).all()


def test_phases_are_given_once(recorded: list[WindowedSpectrum], real_parts: Fit) -> None:
    phased = with_phases(recorded, real_parts, LEAST)
    assert with_phases(recorded, phased, LEAST) is phased
    assert with_phases(recorded, real_parts, 1e9) is real_parts


@pytest.mark.long
def test_a_joint_at_the_tip_moves_inside_where_it_is(chain: ModalModel) -> None:
    lines = [_recorded(chain, level, seed, NEAR_TIP) for seed, level in enumerate((5.0, 12.0))]
    tip = fit(lines, _begun(chain, JointAxis(np.ones(1))), iterations=20)
    inside = moved_away_from_tip(lines, tip, LEAST)
    assert inside.score < tip.score - 100
    axis = inside.hypothesis.causes[-1].axis
    assert axis is not None
    assert phases_too_large(axis) == ""
    assert moved_away_from_tip(lines, inside, LEAST) is inside
    assert moved_away_from_tip(lines, tip, 1e9) is tip


def test_inside_of_the_tip_is_the_tip(chain: ModalModel, recorded: list[WindowedSpectrum]) -> None:
    """A reciprocal structure moves and is pushed alike: the same response from the axis over the modes."""
    tip = _begun(chain, JointAxis(np.ones(1)))
    inside = _begun(chain, axis_over_modes(chain, JointAxis(np.ones(1))))
    first, other = (predict_lines(hypothesis, recorded[0]).response for hypothesis in (tip, inside))
    np.testing.assert_allclose(other, first, atol=1e-6 * float(np.abs(first).max()))


def test_modes_come_and_go_with_both_parts(chain: ModalModel, recorded: list[WindowedSpectrum]) -> None:
    parts = _true_parts(chain)
    axis = JointAxis(np.append(parts.real, parts.imag), modal_scales(chain).with_phases())
    hypothesis = _begun(chain, axis)
    wider = hypothesis.with_mode(-5 + 130j, np.array([1e-5, 0j]), np.ones(1, complex), MISSING_MODE)
    widened = wider.laws[0].axis
    assert widened is not None
    np.testing.assert_allclose(widened.participations(4), np.append(parts, 0.0))
    predicted = partial(predict_lines, lines=recorded[0])
    np.testing.assert_allclose(predicted(wider.without(1)).response, predicted(hypothesis).response, rtol=1e-9)
    again = hypothesis_of(improved_model(hypothesis))
    np.testing.assert_allclose(predicted(again).response, predicted(hypothesis).response, rtol=1e-9)
    turned = replace(axis, entries=-axis.entries)
    np.testing.assert_allclose(turned.with_flipped_sign(1, 3).participations(3), parts * [-1, 1, -1])


@pytest.mark.parametrize(
    ("lead", "said"),
    [((0.05, 0.05, 0.05), ""), ((0.785, 0.785, 0.785), "all modes by 45 degrees"), ((0.6, -0.6, 0.1), "out of phase")],
)
def test_phases_that_turn_a_spring_into_a_damper_are_impossible(
    chain: ModalModel, lead: tuple[float, ...], said: str
) -> None:
    parts = np.array([0.7, 0.7, 0.3]) * np.exp(1j * np.array(lead))
    axis = JointAxis(np.append(parts.real, parts.imag) / np.linalg.norm(parts), modal_scales(chain).with_phases())
    assert (said in phases_too_large(axis)) if said else phases_too_large(axis) == ""
    assert phases_too_large(JointAxis(parts.real)) == ""


def test_phases_are_told(chain: ModalModel) -> None:
    parts = _true_parts(chain)
    axis = JointAxis(np.append(parts.real, parts.imag), modal_scales(chain).with_phases())
    participation = location_of(axis, chain)["participation"]
    assert [abs(entry["part"]) for entry in participation] == pytest.approx(np.abs(parts), abs=1e-5)
    assert max(entry["part"] for entry in participation) == pytest.approx(float(np.abs(parts).max()), abs=1e-5)
    leads = np.degrees(np.angle(parts * np.sign(parts.real)))
    assert [entry["lead_deg"] for entry in participation] == pytest.approx(leads, abs=0.01)
    assert joint_in_words({"participation": participation}).startswith("away from the tip: the mode at ")


def test_a_node_may_be_called_as_parts_of_modes_are(chain: ModalModel, recorded: list[WindowedSpectrum]) -> None:
    named = replace(chain, responses=("MODE1:+X", "ARM:+X"), excitations=("MODE1:+X",))
    plain, other = (_begun(model, axis_over_modes(model, JointAxis(np.ones(1)))) for model in (chain, named))
    first, same = (predict_lines(hypothesis, recorded[0]).response for hypothesis in (plain, other))
    np.testing.assert_allclose(same, first, rtol=1e-9)
