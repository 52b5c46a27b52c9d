"""Synthesis beside measurement: zero for the truth, known for a known error, in every quantity."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import Frf
from millfrf.core import InputError
from modal_fit import ModalModel, Residuals, synthesis

AXIS = np.arange(5.0, 60.0, 0.1)
DOFS = ("1:+Z", "2:+Z", "3:+Z")


def truth() -> ModalModel:
    omega = 2 * np.pi * np.array([14.0, 31.0])
    poles = omega * (-0.01 + 1j)
    shapes = np.random.default_rng(1).uniform(0.3, 1, (2, 3)) + 0j
    residuals = Residuals(np.full((3, 2), 1e-6), np.full((3, 2), 1e-3))
    return ModalModel(poles, shapes, shapes[:, :2] / (2j * poles.imag[:, None]), DOFS, DOFS[:2], residuals=residuals)


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("tau", [None, 0.4])
def test_the_true_model_leaves_nothing(quantity: str, tau: float | None) -> None:
    power = ("receptance", "mobility", "accelerance").index(quantity)
    s = 2j * np.pi * AXIS + (0 if tau is None else 1 / tau)
    values = s[:, None, None] ** power * truth().at(s)
    frf = Frf(AXIS, values, DOFS, DOFS[:2], quantity, "m/N", AXIS > 0, exponential_time_constant=tau)
    made = synthesis(frf, truth(), (10.0, 50.0))
    np.testing.assert_allclose(made.misfit, 0.0, atol=1e-12)
    np.testing.assert_allclose(made.correlation, 1.0)
    assert made.frequencies[0] >= 10
    assert made.frequencies[-1] <= 50


def test_known_errors_are_ranked() -> None:
    frf = truth().frf(AXIS)
    values = frf.values.copy()
    values[:, 1, 0] *= 0.5  # the model is then twice the measurement: a misfit of 1, a correlation of 1
    values[:, 2, 1] *= 1j
    made = synthesis(replace(frf, values=values), truth())
    assert made.ranked()[:2] == ((2, 1), (1, 0))
    assert made.misfit[1, 0] == pytest.approx(1.0)
    assert made.misfit[2, 1] == pytest.approx(np.sqrt(2))
    np.testing.assert_allclose(made.correlation, 1.0)


def test_points_that_the_model_does_not_have_are_left_out() -> None:
    wide = truth().frf(AXIS)
    fewer = replace(truth(), right=truth().right[:, :2], responses=DOFS[:2], residuals=None)
    made = synthesis(wide, fewer)
    assert np.isnan(made.misfit[2]).all()
    assert len(made.ranked()) == 4


def test_another_kind_of_model_is_refused() -> None:
    frf = truth().frf(AXIS)
    with pytest.raises(InputError, match="cannot be compared"):
        synthesis(replace(frf, quantity="transfer", unit="m/V"), truth())
    with pytest.raises(InputError, match="no valid line"):
        synthesis(frf, truth(), (70.0, 80.0))
