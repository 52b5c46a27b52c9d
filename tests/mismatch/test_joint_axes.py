"""Joints at the tip and inside: the same joint told both ways, its file, and what signs of labels leave."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import (
    Hypothesis,
    JointPhysics,
    LabError,
    ModelShape,
    improved_model,
    library,
    predict_lines,
    tip_axes,
)
from millfrf.mismatch.joints.joint_axis import JointAxis, ModalScales, modal_scales
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.model_terms import hypothesis_of
from millfrf.mismatch.physics.linear_causes import MISSING_MODE
from millfrf.mismatch.records.reading import band_of
from modal_fit import ModalModel

TrialOf = Callable[[ModalModel, str, float, int], BandRecording]
DIRECTION = np.array([0.8, 0.6])
MOTION = JointMotion(1e-3, 0.06, 5e-3, 0.3, 5e4)


def _with_joint(model: ModalModel, axis: JointAxis) -> Hypothesis:
    physics = library()["stiffness_hardening"]
    assert isinstance(physics, JointPhysics)
    values = physics.starts(MOTION)[0].copy()
    values[0] = 0.3 * MOTION.stiffness * MOTION.deflection
    shape = ModelShape(model, LabError())
    return Hypothesis(shape, np.zeros(shape.size), (Cause(physics, values, "", axis, MOTION),))


def _inside(model: ModalModel) -> JointAxis:
    """The joint at the tip along `DIRECTION`, as the part of each mode in it."""
    scales = modal_scales(model)
    parts = np.real(model.right @ DIRECTION / scales.seen)
    size = float(np.linalg.norm(parts))
    return JointAxis(parts / size, ModalScales(scales.seen * size, scales.pushed * size))


@pytest.fixture(scope="module")
def lines(small_model: ModalModel, trial_of: TrialOf) -> WindowedSpectrum:
    return windowed_spectrum(trial_of(small_model, "mid", 50.0, 4), band_of(small_model, 128.0), 4.0)


def test_a_joint_at_the_tip_is_one_in_the_modes(small_model: ModalModel, lines: WindowedSpectrum) -> None:
    """Two modes seen along two axes: by reciprocity either axis of the joint says the same."""
    outside, inside = (
        predict_lines(_with_joint(small_model, axis), lines) for axis in (JointAxis(DIRECTION), _inside(small_model))
    )
    assert np.abs(outside.joints[0].force).max() > 0
    np.testing.assert_allclose(inside.joints[0].deflection, outside.joints[0].deflection, atol=1e-12)
    np.testing.assert_allclose(inside.response, outside.response, rtol=1e-9)
    linear = predict_lines(Hypothesis(_with_joint(small_model, JointAxis(DIRECTION)).shape, np.zeros(20)), lines)
    assert np.linalg.norm(linear.response - outside.response) > 0.01 * np.linalg.norm(linear.response)


def test_a_sensor_or_a_force_that_is_counted_the_other_way_changes_no_joint(
    small_model: ModalModel, lines: WindowedSpectrum
) -> None:
    """Data and label of X turned round, of the response and of the force: hardening stays what it is."""
    turn = np.array([-1.0, 1.0])
    labels = ("TCP:-X", "TCP:+Y")
    turned = replace(
        small_model,
        right=small_model.right * turn,
        left=small_model.left * turn,
        responses=labels,
        excitations=labels,
    )
    recording = replace(lines.recording, force=lines.recording.force * turn, response=lines.recording.response * turn)
    other = windowed_spectrum(recording, band_of(small_model, 128.0), 4.0)
    for inside in (False, True):
        plain = JointAxis(DIRECTION) if not inside else JointAxis(DIRECTION, modal_scales(small_model))
        same = JointAxis(DIRECTION) if not inside else JointAxis(DIRECTION, modal_scales(turned))
        first = predict_lines(_with_joint(small_model, plain), lines)
        second = predict_lines(_with_joint(turned, same), other)
        np.testing.assert_allclose(second.response * turn, first.response, rtol=1e-9)


def test_a_response_at_the_node_of_the_force_counts_before_another(small_model: ModalModel) -> None:
    rows, columns, names = tip_axes(
        replace(
            small_model,
            right=np.hstack([small_model.right, small_model.right]),
            responses=("HOUSING:+X", "TCP:-Y", "TCP:-X", "HOUSING:+Y"),
        )
    )
    assert names == ("X", "Y")
    np.testing.assert_array_equal(rows, [[0, 0], [0, -1], [-1, 0], [0, 0]])
    np.testing.assert_array_equal(columns, np.eye(2))


@pytest.mark.parametrize("inside", [False, True])
def test_a_file_keeps_the_axis(small_model: ModalModel, lines: WindowedSpectrum, inside: bool) -> None:
    axis = _inside(small_model) if inside else JointAxis(DIRECTION)
    hypothesis = _with_joint(small_model, axis)
    again = hypothesis_of(improved_model(hypothesis))
    np.testing.assert_allclose(predict_lines(again, lines).response, predict_lines(hypothesis, lines).response)


def test_a_mode_that_comes_and_goes_leaves_the_joint(small_model: ModalModel, lines: WindowedSpectrum) -> None:
    """A further mode takes no part in a joint inside until it is fitted."""
    hypothesis = _with_joint(small_model, _inside(small_model))
    pole = complex(2j * small_model.poles[1].imag - 10.0)
    wider = hypothesis.with_mode(pole, small_model.right[0], small_model.left[0], MISSING_MODE)
    axis = wider.laws[0].axis
    assert axis is not None
    assert axis.entries[2] == 0.0
    assert len(axis.angle_slopes.T) == 2
    np.testing.assert_allclose(
        predict_lines(wider.without(1), lines).response, predict_lines(hypothesis, lines).response, rtol=1e-9
    )
