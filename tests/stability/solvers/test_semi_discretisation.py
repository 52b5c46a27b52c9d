"""Semi-discretisation: stated orders of convergence to collocation's values, another code's radii, refusals."""

import numpy as np
import pytest
from benchmarks_of_literature import HALF_DOWN, RPM, benchmark_cut, one_degree_of_freedom

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, multipliers, semi_discretisation
from millfrf.stability.solvers.semi_discretisation import semi_discretised_multipliers
from replay_data import table_one_model


def radius(steps: int, order: int, cut: tuple[float, str], rpm: float, depth: float) -> float:
    """Spectral radius of the 1-degree-of-freedom benchmark."""
    result = semi_discretised_multipliers(
        one_degree_of_freedom(), benchmark_cut(*cut), rpm * RPM, depth, steps=steps, order=order
    )
    return result.spectral_radius


CUTS = [((0.1, "down"), 6000, 1.7e-3), ((0.5, "up"), 6000, 0.3e-3)]


@pytest.mark.parametrize(("cut", "rpm", "depth"), [*CUTS, ((1.0, "slot"), 20000, 2e-3)])
def test_first_order_converges_with_the_square_of_the_step(cut: tuple[float, str], rpm: float, depth: float) -> None:
    exact = multipliers(one_degree_of_freedom(), benchmark_cut(*cut), rpm * RPM, depth).spectral_radius
    errors = np.abs([radius(steps, 1, cut, rpm, depth) - exact for steps in (20, 40, 80)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2, atol=0.1)


@pytest.mark.parametrize(("cut", "rpm", "depth"), CUTS)
def test_third_order_converges_with_the_fourth_power(cut: tuple[float, str], rpm: float, depth: float) -> None:
    exact = multipliers(one_degree_of_freedom(), benchmark_cut(*cut), rpm * RPM, depth).spectral_radius
    errors = np.abs([radius(steps, 3, cut, rpm, depth) - exact for steps in (20, 40, 80)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4, atol=0.2)


@pytest.mark.parametrize(("steps", "other"), [(40, 1.17618), (80, 1.17761), (160, 1.17796)])
def test_spectral_radii_of_the_slot_by_another_code(steps: int, other: float) -> None:
    """First order, slot, 20000 rpm, 2 mm; by the method of ``published/test_insperger_ding``."""
    assert radius(steps, 1, (1.0, "slot"), 20000, 2e-3) == pytest.approx(other, abs=2e-5)


def test_table_1_by_a_second_road() -> None:
    """Limits and the notch that collocation finds for the modes of Mohammadi & Ahmadi."""
    speeds = np.array([800, 1050, 1600.0]) * RPM
    lobes = semi_discretisation(table_one_model(), HALF_DOWN, speeds, 0.004, steps=16, order=3, n_depths=20)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, [1.67, 1.36, 2.95], rtol=0.01)
    assert lobes.bifurcations == ("hopf", "period-doubling", "hopf")
    assert lobes.chatter_frequencies[1] == pytest.approx(17.5)


def test_absurd_input_is_refused_in_one_line() -> None:
    model, cut = one_degree_of_freedom(), benchmark_cut(1.0, "slot")
    for change, message in (
        ({"depth": -1e-3}, r"depth = -0.001 m"),
        ({"spindle_speed": 0.0}, r"spindle speed 0.0"),
        ({"order": 2}, r"order 2 of semi-discretisation"),
        ({"steps": 1}, r"1 steps are too few"),
    ):
        given = {"spindle_speed": 600.0, "depth": 1e-3, "steps": 20, "order": 1} | change
        with pytest.raises(InputError, match=message):
            semi_discretised_multipliers(model, cut, **given)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="needs a modal model"):
        semi_discretisation(table_one_model().frf(np.arange(1.0, 50.0)), HALF_DOWN, np.array([80.0]), 0.01)


def test_its_chatter_frequency_is_the_strongest_line_of_collocation() -> None:
    """A line is strong where force and receptance both are: the receptance alone named mirror lines."""
    for process, rpm in ((HALF_DOWN, 800.0), (SLOT_OF_FOUR, 260.0), (SLOT_OF_FOUR, 540.0)):
        speed = np.array([rpm]) * RPM
        here, there = (solve(table_one_model(), process, speed, 2e-3) for solve in (semi_discretisation, collocation))
        np.testing.assert_allclose(here.chatter_frequencies, there.chatter_frequencies, rtol=2e-3)


SLOT_OF_FOUR = MillingProcess(4, 0.0127, np.pi / 2, 700e6, 0.17, 0.33, 0.0, np.pi, 1e-4)
