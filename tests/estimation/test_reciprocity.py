"""Reciprocity of FRF matrices and models: exact on reciprocal structures, reported where a channel is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import Frf, reciprocity_pairs, shared_points
from millfrf.gate import check_model_reciprocity, check_reciprocity
from modal_fit import ModalModel, mode_reciprocity
from modal_fit.shapes import reciprocity_residual

AXIS = np.arange(5.0, 60.0, 0.1)
DOFS = ("A:+X", "A:+Y", "B:+X")


def reciprocal(seed: int = 1, dofs: tuple[str, ...] = DOFS) -> ModalModel:
    omega = 2 * np.pi * np.array([14.0, 27.0, 41.0])
    poles = omega * (-0.01 + 1j)
    rng = np.random.default_rng(seed)
    shapes = rng.uniform(0.3, 1, (3, len(dofs))) * rng.choice([-1, 1], (3, len(dofs)))
    return ModalModel(poles, shapes + 0j, shapes / (2j * poles.imag[:, None]), dofs, dofs)


def test_a_reciprocal_matrix_agrees_exactly() -> None:
    pairs = reciprocity_pairs(reciprocal().frf(AXIS))
    assert len(pairs) == 3
    for pair in pairs:
        assert pair.difference == pytest.approx(0.0, abs=1e-12)
        assert pair.correlation == pytest.approx(1.0)
        assert pair.factor == pytest.approx(1.0)
        assert pair.difference_over_frequency.max() < 1e-9
    assert check_reciprocity(reciprocal().frf(AXIS)) == []


def test_sensors_turned_against_their_axis_are_still_reciprocal() -> None:
    """A:-X among the responses, A:+X among the excitations: the sign is in the name."""
    frf = reciprocal().frf(AXIS)
    turned = replace(frf, values=frf.values * np.array([-1, 1, 1])[:, None], responses=("A:-X", "A:+Y", "B:+X"))
    assert max(pair.difference for pair in reciprocity_pairs(turned)) < 1e-12
    model = reciprocal()
    turned_model = replace(model, right=model.right * [-1, 1, 1], responses=turned.responses)
    result = mode_reciprocity(turned_model)
    assert result is not None
    np.testing.assert_allclose(result.assurance, 1.0)
    np.testing.assert_allclose(reciprocity_residual(turned_model), 0.0, atol=1e-12)


@pytest.mark.parametrize(("factor", "remedy"), [(-1.0, "wrong sign"), (2.0, "calibration"), (1.5j, "calibration")])
def test_one_wrong_entry_is_reported_with_its_factor(factor: complex, remedy: str) -> None:
    frf = reciprocal().frf(AXIS)
    values = frf.values.copy()
    values[:, 0, 2] *= factor
    worst = reciprocity_pairs(replace(frf, values=values))[0]
    assert {worst.first, worst.second} == {"A:X", "B:X"}
    assert worst.correlation == pytest.approx(1.0)
    assert worst.factor == pytest.approx(factor)
    expected = abs(factor - 1) / np.sqrt((1 + abs(factor) ** 2) / 2)
    assert worst.difference == pytest.approx(expected)
    [doubt] = check_reciprocity(replace(frf, values=values), "x.h5")
    assert "x.h5 is not reciprocal: A:X / B:X" in doubt
    assert remedy in doubt


def test_noise_that_explains_the_difference_is_no_doubt() -> None:
    frf = reciprocal().frf(AXIS)
    rng = np.random.default_rng(5)
    size = np.sqrt(np.mean(np.abs(frf.values) ** 2, axis=0))
    noise = (rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape)) / np.sqrt(2)
    noisy = frf.values + 0.5 * size * noise
    coherence = 1 / (1 + 5 * (0.5 * size) ** 2 / np.abs(noisy) ** 2)  # of six averages, so that the variance is right
    known = replace(frf, values=noisy, coherence=coherence, averages=np.full((3, 3), 6))
    worst = reciprocity_pairs(known)[0]
    assert worst.noise == pytest.approx(worst.difference, rel=0.1)
    assert check_reciprocity(known) == []
    assert check_reciprocity(replace(known, coherence=None, averages=None)) != []  # nothing tells that it is noise


def test_pairs_need_two_shared_points_and_a_motion_over_force() -> None:
    frf = reciprocal().frf(AXIS)
    column = Frf(AXIS, frf.values[:, :, :1], DOFS, DOFS[:1], "receptance", "m/N", frf.valid)
    assert reciprocity_pairs(column) == ()
    assert reciprocity_pairs(replace(frf, quantity="transfer", unit="m/V")) == ()
    assert [point.name for point in shared_points(("A:+S", "B:-RZ", "odd"), ("A:+S", "B:+RZ", "odd"))] == ["B:RZ"]


def test_left_and_right_vectors_that_disagree_are_reported() -> None:
    model = reciprocal()
    assert check_model_reciprocity(model) == []
    left = model.left.copy()
    left[1] = left[1] * [1, -1, 1]
    [doubt] = check_model_reciprocity(replace(model, left=left), "m.json")
    assert "m.json: left and right vectors of mode 2 at 27 Hz disagree on the 3 points" in doubt
