"""Out-of-band terms of a fit in lobes: one flexibility inside the band, no resonance outside."""

from dataclasses import replace

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, delay_system, with_residual_flexibility
from modal_fit import ModalModel, Residuals
from replay_data import table_one_model

RPM = np.pi / 30
SPEEDS = np.array([800.0, 1200.0, 1836.0]) * RPM
CUT = MillingProcess(2, 12.7e-3, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
BAND = (13.0, 25.0)


def fitted(size: float) -> ModalModel:
    """The robot of Table 1 with a pole that a fit chose above the band; ``size``: its flexibility over the robot's.

    As in fits, a flexibility of the other sign takes away what the pole adds inside the band.
    """
    truth = table_one_model()
    pole = 2 * np.pi * 1.3 * BAND[1] * (-0.05 + 1j * np.sqrt(1 - 0.05**2))
    flexibility = float(np.linalg.norm(truth.receptance(np.array([0.1]))[0]))
    residue = -0.5j * pole.imag * size * flexibility * np.diag([1.0, -1.0, 1.0])
    nothing = np.zeros((3, 3))
    alone = Residuals(nothing, nothing, np.array([pole]), residue[None])
    inside = alone.receptance(2j * np.pi * np.linspace(*BAND, 50)).real.mean(axis=0)
    return replace(truth, residuals=replace(alone, upper=-inside), band=BAND)


def as_if_measured(model: ModalModel) -> ModalModel:
    """The same with the fit's pole as three modes of the structure."""
    assert model.residuals is not None
    assert model.residuals.poles is not None
    assert model.residuals.residues is not None
    return replace(
        model,
        poles=np.concatenate([model.poles, np.repeat(model.residuals.poles, 3)]),
        right=np.concatenate([model.right, np.eye(3, dtype=complex)]),
        left=np.concatenate([model.left, model.residuals.residues[0].T]),
        residuals=replace(model.residuals, poles=None, residues=None),
        covariance=None,
    )


def test_a_pole_of_the_fits_choice_does_not_make_limits() -> None:
    """It makes 4 % of the FRF at the resonances. Taken for a mode, it raises limits by up to a third."""
    truth = certified_lobes(table_one_model(), CUT, SPEEDS, 0.02).depth_limits
    stated = certified_lobes(fitted(1.0), CUT, SPEEDS, 0.02).depth_limits
    resonant = certified_lobes(as_if_measured(fitted(1.0)), CUT, SPEEDS, 0.02).depth_limits
    assert np.abs(stated / truth - 1).max() < 0.01
    assert (resonant / truth - 1).max() > 0.2


def test_the_flexibility_is_the_mean_inside_the_band() -> None:
    model = fitted(1.0)
    assert model.residuals is not None
    stated = with_residual_flexibility(model)
    assert stated.residuals is not None
    s = 2j * np.pi * np.linspace(*BAND, 400)
    np.testing.assert_allclose(stated.residuals.upper, model.residuals.receptance(s).real.mean(axis=0), rtol=1e-12)
    assert stated.residuals.poles is None
    np.testing.assert_array_equal(stated.poles, model.poles)


def test_a_model_without_such_poles_stays_as_it_is() -> None:
    plain = table_one_model()
    assert with_residual_flexibility(plain) is plain


@pytest.mark.parametrize(("size", "warned"), [(1.0, False), (3.0, True)])
def test_a_strong_mode_just_outside_is_told(size: float, warned: bool) -> None:
    said = delay_system(fitted(size), CUT).warnings
    assert any("just outside the fitted band" in each for each in said) == warned
