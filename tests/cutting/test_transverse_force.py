"""Runout of a drill: chips and transverse force against closed forms and against a surface that is cut in steps."""

from math import cos, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.cutting import Drill, bending_stiffness, drilling_load, fitted_to_catalogue, settled_drill
from millfrf.cutting.drilling import SpecificForce, edge_thicknesses, resultant_force

DRILL = Drill(8e-3)


def cut_in_steps(edges: int, angle: float, feed: float, eccentricity: float, direction: float) -> np.ndarray:
    """Normal chip thickness of each edge from a bottom that is kept point by point and lowered edge by edge.

    One circle of the hole's bottom, at a radius beyond the eccentricity; depths count downwards. No formula of the
    program: the drill goes down by feed / 720 a step, every edge removes what stands above it.
    """
    n = 720
    bottom = np.full(n, 0.0)
    steps_of_edge = [round(n * i / edges) for i in range(edges)]
    taken = np.zeros((edges, n))
    for step in range(4 * n):
        for i in range(edges):
            place = (step + steps_of_edge[i]) % n
            depth = step * feed / n + eccentricity * cos(direction - 2 * pi * i / edges) / tan(angle)
            taken[i, step % n] = max(depth - bottom[place], 0.0)
            bottom[place] = max(bottom[place], depth)
    return np.asarray(taken[:, -n:].mean(axis=1) * sin(angle))


@settings(max_examples=15, deadline=None)
@given(
    st.sampled_from([2, 3, 4]),
    st.floats(0.8, 1.4),
    st.floats(0.0, 0.3e-3),
    st.floats(0.0, 2 * pi),
    st.floats(1e-4, 3e-4),
)
def test_chips_are_those_of_a_surface_cut_in_steps(
    edges: int, angle: float, runout: float, direction: float, feed: float
) -> None:
    drill = Drill(8e-3, edge_angle=angle, edges=edges)
    result = edge_thicknesses(drill, feed, runout, direction)
    assert result == pytest.approx(cut_in_steps(edges, angle, feed, runout / 2, direction), abs=1e-9)
    assert result.sum() == pytest.approx(feed * sin(angle))  # every revolution takes the whole feed


def test_two_edges_at_constant_pressure() -> None:
    """``F_t1 - F_t2 = k_t R 2 rho cot chi cos``, and the same of ``F_a cot chi`` along the edges."""
    kt, ka, rho, feed, direction = 900e6, 500e6, 20e-6, 0.2e-3, 0.7
    flat = [SpecificForce(k, 0.0, 1.0, 0.0, 0.0) for k in (kt, ka)]
    result = resultant_force(DRILL, feed, *flat, rho, direction=direction)
    cot = 1 / tan(DRILL.edge_angle)
    unequal = DRILL.diameter / 2 * 2 * rho * cot * cos(direction)
    assert result.force == pytest.approx([-ka * cot * unequal, -kt * unequal])
    across = resultant_force(DRILL, feed, *flat, rho, direction=pi / 2)
    assert across.size < 1e-9  # eccentric across the edges: chips stay equal


def test_more_than_the_feed_leaves_one_edge_to_cut_alone() -> None:
    """Runout beyond ``f tan(chi) / 2``: one edge takes the whole feed, so F_r is its whole force."""
    forces = fitted_to_catalogue(DRILL)
    result = resultant_force(DRILL, 0.1e-3, *forces, 1.1 * 0.1e-3 * tan(DRILL.edge_angle) / 2)
    assert result.thicknesses[1] == 0.0
    alone = drilling_load(Drill(8e-3, edges=1), 0.1e-3, *forces).thrust / tan(DRILL.edge_angle)
    assert -result.force[0] == pytest.approx(alone)


def by_midpoints(force: SpecificForce, thickness: float) -> float:
    """Force of one edge at a chip thickness, N: Kienzle's law with the paper's rake (Eq. 16), summed piece by piece."""
    total, pieces, radius = 0.0, 2000, DRILL.diameter / 2
    for i in range(pieces):
        share = (i + 0.5) / pieces
        rake = np.arctan(share * tan(DRILL.rake))
        pressure = force.k0 * (force.a + force.b * rake) * (1e3 * thickness) ** -force.m
        total += pressure * thickness * radius / pieces / sin(DRILL.edge_angle)
    return total


def test_transverse_force_of_the_paper() -> None:
    """Fig. 7a as a trend: F_r rises with runout, from nothing, and with the drill's entry (aluminium, 8 mm)."""
    forces = fitted_to_catalogue(DRILL)
    sizes = [resultant_force(DRILL, 0.2e-3, *forces, 1e-6 * rho).size for rho in (0, 10, 20, 40, 80)]
    assert sizes[0] < 1e-9
    assert np.all(np.diff(sizes) > 0)
    unequal = 20e-6 * cos(DRILL.edge_angle)
    thick, thin = (1e-4 * sin(DRILL.edge_angle) + sign * unequal for sign in (1, -1))
    cut, thrust = (by_midpoints(force, thick) - by_midpoints(force, thin) for force in forces)
    assert sizes[2] == pytest.approx(np.hypot(cut, thrust / tan(DRILL.edge_angle)), rel=1e-5)
    assert sizes[2] == pytest.approx(89, abs=1)  # N at 20 um of runout, beside a thrust of 1170 N
    entering = [resultant_force(DRILL, 0.2e-3, *forces, 20e-6, depth=d).size for d in (0.2e-3, 0.6e-3, 1.2e-3, np.inf)]
    assert np.all(np.diff(entering) > 0)
    with pytest.raises(InputError, match="half the drill"):
        resultant_force(DRILL, 0.2e-3, *forces, 5e-3)


def test_a_clamped_drill_bends_as_a_bar() -> None:
    assert bending_stiffness(Drill(10e-3), 0.1, core=1.0) == pytest.approx(3 * 600e9 * pi * 0.01**4 / 64 / 0.1**3)
    with pytest.raises(InputError, match="overhang"):
        bending_stiffness(Drill(10e-3), 60e-6)
    assert Drill(8e-3).edge_angle == radians(70)


def test_a_drill_that_gives_way_centres_itself() -> None:
    """Constant pressures: ``e_x = e_0x / (1 + C K_r)``, ``e_y = e_0y - C K_t e_x`` by hand, and the force behind it."""
    kt, ka, rho, direction = 900e6, 500e6, 20e-6, 0.7
    flat = [SpecificForce(k, 0.0, 1.0, 0.0, 0.0) for k in (kt, ka)]
    cot = 1 / tan(DRILL.edge_angle)
    radial, across = 2 * ka * DRILL.diameter * cot**2, 2 * kt * DRILL.diameter * cot
    for compliance in (0.0, 1e-7, 2e-6, 1e-5):
        result = settled_drill(DRILL, 0.2e-3, *flat, rho, compliance, direction=direction)
        x = rho / 2 * cos(direction) / (1 + compliance * radial)
        y = rho / 2 * sin(direction) - compliance * across * x
        assert result.eccentricity == pytest.approx([x, y], rel=1e-6, abs=1e-12)
        assert result.force.force == pytest.approx([-radial * x, -across * x], rel=1e-6, abs=1e-9)
    with pytest.raises(InputError, match="zero or more"):
        settled_drill(DRILL, 0.2e-3, *flat, rho, -1.0)


def test_long_drills_carry_less_force_and_bend_no_further_than_their_pressures_say() -> None:
    forces = fitted_to_catalogue(DRILL)
    settled = [
        settled_drill(DRILL, 0.2e-3, *forces, 20e-6, 1 / bending_stiffness(DRILL, length))
        for length in (0.01, 0.03, 0.05, 0.1, 0.2)
    ]
    sizes = [each.force.size for each in settled]
    assert np.all(np.diff(sizes) < 0)
    assert sizes[0] > 80  # nearly the 89 N of a stiff drill
    assert sizes[2] == pytest.approx(18.6, abs=0.1)
    assert max(np.hypot(*each.bending) for each in settled) < 40e-6
