"""Beams against closed forms, and pieces against the beam that they make."""

from collections.abc import Callable

import numpy as np
import pytest
import scipy

from modal_fit import ToolTable, bending_stiffness, shear_factor
from modal_fit.substructures.assembly import FreeTool, free_tool
from modal_fit.substructures.tool_file import Tool

YOUNG, DENSITY, POISSON, DIAMETER, LENGTH = 580e9, 14500.0, 0.22, 0.012, 0.08
AREA, MOMENT = np.pi / 4 * DIAMETER**2, np.pi / 64 * DIAMETER**4


def determinant(free: list[int], *, timoshenko: bool) -> Callable[[float], float]:
    """Determinant of the loss-free stiffness over the degrees of freedom that may move, by angular frequency."""
    shear, rotary = np.inf, 0.0
    if timoshenko:
        shear = shear_factor(POISSON, 0.0) * YOUNG / (2 * (1 + POISSON)) * AREA
        rotary = DENSITY * MOMENT

    def value(omega: float) -> float:
        s = np.array([1j * omega])
        stiffness = bending_stiffness(YOUNG * MOMENT, shear, DENSITY * AREA, rotary, LENGTH, s, 0.0)[0]
        scale = np.array([1.0, LENGTH, 1.0, LENGTH])
        scaled = (stiffness / np.outer(scale, scale))[np.ix_(free, free)] / (YOUNG * MOMENT / LENGTH**3)
        return float(np.linalg.det(scaled).real)

    return value


# Blevins, Formulas for Natural Frequency and Mode Shape, 1979, table 8-1; free beams by halves, with the middle guided
# (4.73004074, 10.9956078) or pinned (7.85320462), because a whole free beam has the frequencies of a clamped one
@pytest.mark.parametrize(
    ("free", "wave_numbers"),
    [
        ([0, 1, 2], (4.73004074 / 2, 10.9956078 / 2)),
        ([0, 1, 3], (7.85320462 / 2,)),
        ([2, 3], (1.87510407, 4.69409113)),
        ([1, 3], (np.pi, 2 * np.pi)),
    ],
)
def test_euler_beams_have_the_published_wave_numbers(free: list[int], wave_numbers: tuple[float, ...]) -> None:
    for number in wave_numbers:
        omega = (number / LENGTH) ** 2 * np.sqrt(YOUNG * MOMENT / (DENSITY * AREA))
        result = scipy.optimize.brentq(determinant(free, timoshenko=False), 0.99 * omega, 1.01 * omega, rtol=1e-12)
        assert result == pytest.approx(omega, rel=1e-8)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_pinned_timoshenko_beam_has_the_frequencies_of_its_closed_form(order: int) -> None:
    # rho I / (kappa G) w^4 - (rho A + rho I k^2 + E I k^2 rho A / (kappa G A)) w^2 + E I k^4 = 0 with k = n pi / L
    k, shear = order * np.pi / LENGTH, shear_factor(POISSON, 0.0) * YOUNG / (2 * (1 + POISSON)) * AREA
    mass, rotary, bending = DENSITY * AREA, DENSITY * MOMENT, YOUNG * MOMENT
    squares = np.roots([mass * rotary / shear, -(mass + rotary * k**2 + bending * k**2 * mass / shear), bending * k**4])
    omega = float(np.sqrt(squares.min()))
    result = scipy.optimize.brentq(determinant([1, 3], timoshenko=True), 0.99 * omega, 1.01 * omega, rtol=1e-12)
    assert result == pytest.approx(omega, rel=1e-9)


def tool(*segments: dict[str, object], **points: float) -> Tool:
    """A carbide tool."""
    carbide = {"youngs_modulus_pa": YOUNG, "density_kg_per_m3": DENSITY, "poissons_ratio": POISSON}
    table = {
        "material": {"carbide": carbide},
        "segment": [{"material": "carbide", **each} for each in segments],
        "distance_from_tip_m": points,
    }
    return Tool("tool.toml", ToolTable.model_validate(table))


S = 2j * np.pi * np.linspace(30.0, 8000.0, 60)


def free(described: Tool, compliance: complex = 0j) -> FreeTool:
    """Free receptance at tip and middle."""
    return free_tool(described, ("TCP", "MID"), S, np.full(2, compliance))


def largest_difference(first: FreeTool, second: FreeTool) -> float:
    """Largest difference over the size of each matrix."""
    pairs = ((first.end, second.end), (first.across, second.across), (first.points, second.points))
    return max(float(np.max(np.abs(a - b)) / np.abs(b).max()) for a, b in pairs)


def test_beams_that_are_joined_are_the_beam_made_as_a_whole() -> None:
    points = {"TCP": 0.0, "MID": 0.03}
    whole = free(tool({"length_m": 0.08, "diameter_m": 0.012}, **points))
    first, second = {"length_m": 0.05, "diameter_m": 0.012}, {"length_m": 0.03, "diameter_m": 0.012}
    assert largest_difference(free(tool(first, second, **points)), whole) < 1e-9
    assert largest_difference(free(tool(first, second | {"contact": True}, **points)), whole) < 1e-9
    soft = free(tool(first, second | {"contact": True}, **points), 1e-4 - 1e-5j)
    assert largest_difference(soft, whole) > 1e-3


def test_a_tool_on_a_rigid_base_bends_like_a_cantilever() -> None:
    described = tool({"length_m": 0.08, "diameter_m": 0.012}, TCP=0.0, MID=0.03)
    at_rest = free_tool(described, ("TCP",), np.array([2j * np.pi * 0.5]), np.zeros(2, dtype=complex))
    shear = shear_factor(POISSON, 0.0) * YOUNG / (2 * (1 + POISSON)) * AREA
    expected = LENGTH**3 / (3 * YOUNG * MOMENT) + LENGTH / shear
    assert at_rest.on_base(np.zeros((1, 2, 2), dtype=complex))[0, 0, 0].real == pytest.approx(expected, rel=1e-5)


def test_flutes_are_a_thinner_cylinder() -> None:
    fluted = tool({"length_m": 0.05, "diameter_m": 0.010, "fluted": True, "effective_share": 0.8}, TCP=0.0, MID=0.02)
    thin = tool({"length_m": 0.05, "diameter_m": 0.008}, TCP=0.0, MID=0.02)
    assert largest_difference(free(fluted), free(thin)) < 1e-12
