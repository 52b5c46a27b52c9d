"""Exact dynamic stiffness against closed forms, characteristic equations and invariants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from millfrf.robot_model.dynamic_stiffness import (
    block_diagonal,
    couple_receptances,
    planar_dynamic_stiffness,
    spatial_dynamic_stiffness,
)
from millfrf.robot_model.finite_elements.beam_element import Material, Section, hollow_circle

STEEL = Material(210e9, 81e9, 7850.0)
THIN = hollow_circle(0.04, 0.02, STEEL, timoshenko=False)
THICK = hollow_circle(0.2, 0.1, STEEL)


def closed_form(section: Section, length: float, omega: float) -> np.ndarray:
    """Chen et al. 2026, appendix, Euler-Bernoulli, with the lost signs put back (Clough & Penzien, section 19-3)."""
    lam = length * (section.mass * omega**2 / section.bending_z) ** 0.25
    c, s, ch, sh = np.cos(lam), np.sin(lam), np.cosh(lam), np.sinh(lam)
    unit = section.bending_z / (1 - c * ch)
    d2 = unit * lam**3 * (c * sh + s * ch) / length**3
    d3 = unit * lam**2 * s * sh / length**2
    d4 = unit * lam * (s * ch - c * sh) / length
    d6 = -unit * lam**3 * (s + sh) / length**3
    d7 = unit * lam**2 * (ch - c) / length**2
    d8 = unit * lam * (sh - s) / length
    return np.array([[d2, d3, d6, d7], [d3, d4, -d7, d8], [d6, -d7, d2, -d3], [d7, d8, -d3, d4]])


@pytest.mark.parametrize("lam", [0.3, 1.0, 3.0, 8.0, 25.0])
def test_bending_is_the_closed_form(lam: float) -> None:
    omega = lam**2 * np.sqrt(THIN.bending_z / THIN.mass) / 0.8**2
    bend = planar_dynamic_stiffness(THIN, 0.8, np.array([omega]))[0][np.ix_([1, 2, 4, 5], [1, 2, 4, 5])]
    expected = closed_form(THIN, 0.8, omega)
    # below lam = 1 the closed form itself loses eps / lam^4
    assert np.abs(bend - expected).max() < max(1e-11, 1e-15 / lam**4) * np.abs(expected).max()


def test_static_limit_is_the_beam_element() -> None:
    length, bending = 0.8, THIN.bending_z
    static = planar_dynamic_stiffness(THIN, length, np.zeros(1))[0].real
    assert static[1, 1] == pytest.approx(12 * bending / length**3, rel=1e-12)
    assert static[2, 5] == pytest.approx(2 * bending / length, rel=1e-12)
    assert static[0, 0] == pytest.approx(THIN.axial / length, rel=1e-12)


@pytest.mark.parametrize("root", [1.875104068711961, 4.694091132974175])
def test_cantilever_frequencies(root: float) -> None:
    """``cos lambda cosh lambda = -1``."""
    unit = np.sqrt(THIN.bending_z / THIN.mass)

    def determinant(lam: float) -> float:
        free = planar_dynamic_stiffness(THIN, 1.0, np.array([lam**2 * unit]))[0][4:, 4:]
        return float(np.linalg.det(free).real)

    assert brentq(determinant, root - 0.02, root + 0.02, xtol=1e-12) == pytest.approx(root, rel=1e-9)


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_simply_supported_timoshenko_beam(mode: int) -> None:
    """(rho I)(rho A)/(kappa G A) w^4 - [rho A + k^2 (rho I + E I rho A/(kappa G A))] w^2 + E I k^4 = 0."""
    length, wave = 0.9, mode * np.pi / 0.9
    quadratic = [
        THICK.rotary_z * THICK.mass / THICK.shear_y,
        -(THICK.mass + wave**2 * (THICK.rotary_z + THICK.bending_z * THICK.mass / THICK.shear_y)),
        THICK.bending_z * wave**4,
    ]
    expected = np.sqrt(np.roots(quadratic).min())

    def determinant(omega: float) -> float:
        whole = planar_dynamic_stiffness(THICK, length, np.array([omega]))[0]
        return float(np.linalg.det(whole[np.ix_([2, 5], [2, 5])] / THICK.bending_z).real)

    assert brentq(determinant, 0.97 * expected, 1.03 * expected, xtol=1e-9) == pytest.approx(expected, rel=1e-9)


@settings(max_examples=25)
@given(st.floats(0.02, 0.3), st.floats(0.0, 0.9), st.floats(0.1, 2.0), st.floats(1.0, 3000.0), st.floats(0.0, 0.2))
def test_reciprocity_and_dissipation(outer: float, share: float, length: float, hertz: float, loss: float) -> None:
    section = hollow_circle(outer, share * outer, STEEL)
    stiffness = spatial_dynamic_stiffness(section, length, np.array([2 * np.pi * hertz]), loss)[0]
    size = np.abs(stiffness).max()
    assert np.abs(stiffness - stiffness.T).max() <= 1e-9 * size
    assert np.linalg.eigvalsh(stiffness.imag).min() >= -1e-7 * size  # a lossy beam takes power, at every motion


def test_two_halves_coupled_rigidly_are_the_whole() -> None:
    omega = 2 * np.pi * np.array([20.0, 300.0, 2100.0])
    half = np.linalg.inv(planar_dynamic_stiffness(THICK, 0.5, omega, 0.02))
    apart = block_diagonal([half, half])
    joined = couple_receptances(apart, [(3, 6), (4, 7), (5, 8)], [0, 0, 0])
    ends = [0, 1, 2, 9, 10, 11]
    whole = np.linalg.inv(planar_dynamic_stiffness(THICK, 1.0, omega, 0.02))
    assert np.abs(joined[:, ends][:, :, ends] - whole).max() < 1e-8 * np.abs(whole).max()
