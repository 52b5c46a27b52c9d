"""The scale of a joint's deflection is a convention where no channel shows it: a prediction does not depend on it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_joint import law_of, moved_by, with_law
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from trial_case import diagnosed

from millfrf.mismatch import AcceptedCause, Hypothesis, LabError, ModelShape, predict_lines
from millfrf.mismatch.joints.joint_axis import JointAxis, ModalScales, axis_over_modes
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.models.model_terms import (
    counted_at_tip,
    scale_at_tip,
    scaled,
    spread_with_scale,
)
from millfrf.mismatch.physics.library import Rig, in_units, rig_of
from millfrf.mismatch.structure.reported_causes import unknown_scales
from modal_fit import ModalModel

LAWS = {
    "backlash": [2e4, 1e-4],
    "coulomb_friction": [6.0, 2e-3],
    "hysteresis": [6e4, 2e-4, 0.8],
    "pose_drift": [2e4, 0.3, 1e3],
    "presliding_friction": [6.0, 3e-5],
    "quadratic_damping": [3e3],
    "stiffness_hardening": [1.0, 3.0],
    "stiffness_softening": [3e4, 1e-4, 2.0],
}

POLES = np.array([-1.2 + 41j, -1.5 + 46j, -4 + 130j])
"""Two of the modes are so close that one force moves both."""


def close_modes() -> tuple[ModalModel, JointAxis]:
    """Three modes seen along X and Y, and a joint inside that all of them move."""
    rng = np.random.default_rng(8)
    right = rng.normal(size=(3, 2)) + 0.1j * rng.normal(size=(3, 2))
    left = right / (2j * POLES.imag[:, None])
    parts = rng.normal(size=3)
    labels = ("TCP:+X", "TCP:+Y")
    scales = ModalScales(np.ones(3, dtype=complex), 1 / (2j * POLES.imag))
    return ModalModel(POLES, right, left, labels, labels), JointAxis(parts / np.linalg.norm(parts), scales)


def test_the_scale_is_that_of_a_regression_under_white_forces() -> None:
    """Independent of Lyapunov's equation: spectra of the deflection and of the tip, integrated over frequency."""
    model, axis = close_modes()
    assert axis.scales is not None
    seen = np.column_stack([model.right, axis.entries * axis.scales.seen])

    def spectra(omega: float) -> NDArray[np.float64]:
        both = (np.einsum("rp,rq,r->pq", v, w, 1 / (1j * omega - p)) for v, w, p in conjugates(model, seen))
        receptance = sum(both, np.zeros((3, 2), dtype=complex))
        return np.asarray((receptance @ receptance.conj().T).real)

    motion = quad_vec(spectra, 0.0, np.inf, epsrel=1e-9, points=list(POLES.imag))[0]
    expected = np.linalg.norm(np.linalg.solve(motion[:2, :2], motion[:2, 2]))
    assert scale_at_tip(axis, model) == pytest.approx(expected, rel=1e-5)
    # modes taken one by one are another regression
    sizes = np.linalg.norm(model.left, axis=1) / np.sqrt(-POLES.real)
    alone = np.linalg.lstsq((sizes[:, None] * model.right).real, sizes * axis.entries, rcond=None)[0]
    assert abs(np.linalg.norm(alone) / expected - 1) > 0.05


def conjugates(model: ModalModel, seen: NDArray[np.complex128]) -> list[tuple[NDArray[np.complex128], ...]]:
    """Right vectors, left vectors and poles, and their conjugates."""
    single = seen, model.left, model.poles
    return [single, tuple(values.conj() for values in single)]


def test_errors_hold_what_is_not_known_of_the_scale() -> None:
    """Numbers of many draws from the fit's covariance, each counted in the tip of its own modes and parts."""
    model, axis = close_modes()
    shape = ModelShape(model, LabError())
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, 1e5)
    start = Hypothesis(shape, np.zeros(shape.size))
    hidden = counted_at_tip(start.with_cause(Cause(law_of("backlash"), np.array([2e4, 1e-4]), "", axis, motion)))
    rng = np.random.default_rng(3)
    sizes = np.concatenate([np.full(shape.size, 0.05), [0.1, 0.1, 0.5, 0.5]])
    root = sizes[:, None] * rng.normal(size=(hidden.size, hidden.size))
    covariance = root @ root.T / hidden.size
    result = Fit(hidden, (), 0.0, 0.0, 0.0, covariance)
    drawn = rng.multivariate_normal(np.zeros(hidden.size), covariance, size=2000)
    stated = []
    for each in drawn:
        there = replace(hidden, u=each[: shape.size]).with_causes(hidden.coordinates() + each[shape.size :])
        stated.append(counted_at_tip(there).causes[-1].coordinates()[:2])
    seen = np.cov(np.array(stated).T)
    np.testing.assert_allclose(spread_with_scale(result, 0), seen, rtol=0.1)
    assert np.all(seen.diagonal() > 1.5 * covariance[-4:-2, -4:-2].diagonal())


@pytest.mark.parametrize("name", sorted(LAWS))
def test_lengths_and_forces_of_a_joint_inside_have_no_scale_of_their_own(name: str) -> None:
    """A joint at the tip, told as one inside, in another scale: all predict the same, and the tip's scale is found."""
    hidden = with_law(law_of(name), np.array(LAWS[name]))
    cause = hidden.causes[-1]
    assert cause.axis is not None
    inside = replace(cause, axis=axis_over_modes(hidden.model, cause.axis))
    assert inside.axis is not None
    assert scale_at_tip(inside.axis, hidden.model) == pytest.approx(1.0)
    other = replace(hidden, causes=(scaled(inside, 1.7),))
    counted = counted_at_tip(other)
    np.testing.assert_allclose(counted.causes[-1].values, cause.values, rtol=1e-9)
    (line,) = moved_by(hidden, (40.0,))
    bare = predict_lines(hidden.without(0), line).response
    first, *others = (predict_lines(each, line).response for each in (hidden, other, counted))
    for shown in others:
        assert np.linalg.norm(shown - first) < 2e-3 * np.linalg.norm(first - bare)


@pytest.mark.parametrize("unit", ["m/m/s^2", "m/V", "rad/N m"])
def test_a_joint_keeps_the_scale_of_its_fit_where_forces_do_not_drive(unit: str) -> None:
    """Driven by the acceleration of a base, by a voltage or a moment: no number is rescaled, and no error grows."""
    model, axis = close_modes()
    model = replace(model, unit=unit)
    shape, motion = ModelShape(model, LabError()), JointMotion(1e-3, 0.06, 1e-2, 0.6, 1e5)
    law = in_units(law_of("backlash"), rig_of(model))
    hidden = Hypothesis(shape, np.zeros(shape.size)).with_cause(Cause(law, np.array([2e4, 1e-4]), "", axis, motion))
    covariance = np.diag(np.linspace(1e-3, 2e-3, hidden.size))
    assert counted_at_tip(hidden) == hidden
    spread = spread_with_scale(Fit(hidden, (), 0.0, 0.0, 0.0, covariance), 0)
    np.testing.assert_array_equal(spread, covariance[shape.size : shape.size + 2, shape.size : shape.size + 2])
    inside = AcceptedCause("backlash", {"participation": [{"mode_hz": 9.0, "part": 1.0}]}, {}, {}, 900.0)
    (said,) = unknown_scales([inside], rig_of(model))
    assert "its scale is that of the fit" in said


def test_the_answer_says_so() -> None:
    inside = AcceptedCause("backlash", {"participation": [{"mode_hz": 9.0, "part": 1.0}]}, {}, {}, 900.0)
    (said,) = unknown_scales([inside], Rig())
    assert "backlash" in said
    assert unknown_scales([replace(inside, location={"direction": [1.0, 0.0]})], Rig()) == ()


def test_a_joint_that_moves_with_no_tip_keeps_its_errors() -> None:
    model, axis = close_modes()
    assert axis.scales is not None
    still = replace(axis, scales=replace(axis.scales, seen=np.zeros(3, dtype=complex)))
    assert scale_at_tip(still, model) == 0.0
    shape = ModelShape(model, LabError())
    motion = JointMotion(1e-3, 0.06, 1e-2, 0.6, 1e5)
    cause = Cause(law_of("backlash"), np.array([2e4, 1e-4]), "", still, motion)
    hidden = Hypothesis(shape, np.zeros(shape.size)).with_cause(cause)
    covariance = np.diag(np.arange(1.0, hidden.size + 1))
    own = slice(shape.size, shape.size + 2)
    np.testing.assert_array_equal(spread_with_scale(Fit(hidden, (), 0, 0, 0, covariance), 0), covariance[own, own])


@pytest.mark.slow
def test_a_law_that_is_clear_at_the_tip_alone_is_told(tmp_path: Path) -> None:
    """Before: stiffness and knee were known to 40 % in the joint's own scale, and the answer was `unexplained`."""
    diagnosis = diagnosed(tmp_path, "extended", 300, 4602, 50)
    assert [each.name for each in diagnosis.physics] == ["missing_mode", "stiffness_hardening"]
    assert diagnosis.equivalents == ("backlash",)
