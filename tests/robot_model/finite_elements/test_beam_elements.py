"""Beam elements against exact beam theory: convergence rates, rigid motion, and the dynamic stiffness in the limit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from millfrf.robot_model.dynamic_stiffness import spatial_dynamic_stiffness
from millfrf.robot_model.finite_elements.beam_element import Material, Section, beam_mass, beam_stiffness, hollow_circle
from millfrf.robot_model.finite_elements.structure import (
    Beam,
    Structure,
    coordinate_basis,
    mass_matrix,
    stiffness_matrix,
)

STEEL = Material(210e9, 81e9, 7850.0)
SECTION = hollow_circle(0.1, 0.05, STEEL)
THIN = hollow_circle(0.1, 0.05, STEEL, timoshenko=False)


def _cantilever(section: Section, n_elements: int, length: float = 1.0) -> Structure:
    positions = np.column_stack([np.linspace(0, length, n_elements + 1), np.zeros((n_elements + 1, 2))])
    beams = tuple(Beam((i, i + 1), np.eye(3), section) for i in range(n_elements))
    return Structure(positions, (), beams, (), (), n_elements)


def _frequencies(structure: Structure) -> np.ndarray:
    basis = coordinate_basis(structure)
    stiffness, mass = (basis.T @ matrix(structure) @ basis for matrix in (stiffness_matrix, mass_matrix))
    return np.asarray(np.sqrt(eigh(stiffness, mass, eigvals_only=True)))


@pytest.mark.parametrize(("mode", "root"), [(0, 1.875104068711961), (1, 4.694091132974175), (2, 7.854757438237613)])
def test_bending_converges_with_the_fourth_power(mode: int, root: float) -> None:
    exact = root**2 * np.sqrt(THIN.bending_z / THIN.mass)
    errors = []
    for n in (4, 8):
        pairs = _frequencies(_cantilever(THIN, n))
        nearest = pairs[np.argmin(np.abs(pairs - exact))]
        errors.append(nearest / exact - 1)
    assert errors[0] > errors[1] > 0  # a consistent mass bounds frequencies from above
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.35)


@pytest.mark.parametrize("wave", ["axial", "torsion"])
def test_rods_converge_with_the_second_power(wave: str) -> None:
    stiffness, mass = (THIN.axial, THIN.mass) if wave == "axial" else (SECTION.torsion, SECTION.polar)
    exact = np.pi / 2 * np.sqrt(stiffness / mass)
    errors = []
    for n in (4, 8):
        result = _frequencies(_cantilever(THIN if wave == "axial" else SECTION, n))
        errors.append(np.abs(result / exact - 1).min())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)


@pytest.mark.parametrize(("section", "order"), [(THIN, 4), (SECTION, 2)], ids=["euler-bernoulli", "timoshenko"])
def test_elements_tend_to_the_exact_dynamic_stiffness(section: Section, order: int) -> None:
    """With shear the static shapes lack the bend that inertia gives through shear, so the order is 2."""
    omega = 2 * np.pi * 150.0
    exact = np.linalg.inv(spatial_dynamic_stiffness(section, 1.0, np.array([omega]))[0][6:, 6:].real)
    errors = []
    for n in (4, 8):
        structure = _cantilever(section, n)
        dynamic = stiffness_matrix(structure)[6:, 6:] - omega**2 * mass_matrix(structure)[6:, 6:]
        tip = np.linalg.inv(dynamic)[-6:, -6:]
        errors.append(np.abs(tip - exact)[[1, 2, 4, 5]][:, [1, 2, 4, 5]].max())
    assert errors[1] < 1e-4 * np.abs(exact).max()
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


def test_static_tip_deflection_of_a_timoshenko_beam() -> None:
    """``F L^3 / (3 E I) + F L / (kappa G A)``, exact with one element."""
    structure = _cantilever(SECTION, 1, 0.4)
    tip = np.linalg.inv(stiffness_matrix(structure)[6:, 6:])
    assert tip[1, 1] == pytest.approx(0.4**3 / (3 * SECTION.bending_z) + 0.4 / SECTION.shear_y, rel=1e-12)


@settings(max_examples=25)
@given(st.floats(0.02, 0.4), st.floats(0, 0.9), st.floats(0.05, 2), st.booleans())
def test_rigid_motion_costs_nothing_and_has_the_mass_of_the_beam(
    outer: float, share: float, length: float, shear: bool
) -> None:
    section = hollow_circle(outer, share * outer, STEEL, timoshenko=shear)
    stiffness, mass = beam_stiffness(section, length), beam_mass(section, length)
    rigid = np.zeros((12, 6))
    rigid[:6] = np.eye(6)
    rigid[6:] = np.eye(6)
    rigid[7, 5], rigid[8, 4] = length, -length
    assert np.abs(stiffness @ rigid).max() < 1e-9 * np.abs(stiffness).max()
    assert np.linalg.eigvalsh(stiffness).min() > -1e-9 * np.abs(stiffness).max()
    inertia = rigid.T @ mass @ rigid
    whole = section.mass * length
    assert np.diag(inertia)[:3] == pytest.approx([whole] * 3, rel=1e-12)
    assert inertia[5, 5] == pytest.approx(whole * length**2 / 3 + section.rotary_z * length, rel=1e-9)
