"""Drilling forces: the maker's catalogue, closed forms, tool entry."""

from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.cutting import Drill, drilling_load, fitted_to_catalogue
from millfrf.cutting.drilling import SpecificForce, catalogue_load

DRILL = Drill(8e-3)


@pytest.mark.parametrize("diameter", [5e-3, 8e-3, 10e-3, 12e-3])
@pytest.mark.parametrize("feed", [0.1e-3, 0.15e-3, 0.2e-3, 0.3e-3])
def test_one_drill_fitted_gives_the_catalogue_for_all_within_a_tenth(diameter: float, feed: float) -> None:
    tangential, axial = fitted_to_catalogue(DRILL)
    result, expected = drilling_load(Drill(diameter), feed, tangential, axial), catalogue_load(diameter, feed)
    assert result.thrust == pytest.approx(expected.thrust, rel=0.1)
    assert result.torque == pytest.approx(expected.torque, rel=0.1)


def test_published_figures_of_the_eight_millimetre_drill() -> None:
    load = drilling_load(DRILL, 0.2e-3, *fitted_to_catalogue(DRILL))
    assert load.thrust == pytest.approx(1170, rel=0.1)
    assert load.torque == pytest.approx(2.6, rel=0.1)


def test_constant_pressure_has_a_closed_form() -> None:
    """With m = b = 0: ``F_a = k f D / 2`` and ``M = k f D^2 / 8``, whatever the point angle."""
    force = SpecificForce(1e9, 0.0, 1.0, 0.0, 0.0)
    for angle in (50.0, 70.0, 90.0):
        load = drilling_load(Drill(10e-3, radians(angle)), 0.2e-3, force, force)
        assert load.thrust == pytest.approx(1e9 * 0.2e-3 * 10e-3 / 2, rel=1e-12)
        assert load.torque == pytest.approx(1e9 * 0.2e-3 * 10e-3**2 / 8, rel=1e-12)


@settings(max_examples=30)
@given(st.floats(0.0, 5e-3), st.floats(0.0, 5e-3))
def test_load_grows_as_the_drill_enters(first: float, second: float) -> None:
    forces = fitted_to_catalogue(DRILL)
    low, high = (drilling_load(DRILL, 0.2e-3, *forces, depth=d) for d in sorted((first, second)))
    whole = drilling_load(DRILL, 0.2e-3, *forces)
    assert 0 <= low.thrust <= high.thrust * (1 + 1e-12) <= whole.thrust * (1 + 1e-9)
    assert 0 <= low.torque <= high.torque * (1 + 1e-12) <= whole.torque * (1 + 1e-9)
    if min(first, second) >= 4e-3 / np.tan(DRILL.edge_angle):
        assert low.thrust == pytest.approx(whole.thrust, rel=1e-12)


def test_inclination_counts_where_its_coefficient_is_not_zero() -> None:
    force = SpecificForce(1e9, 0.2, 1.0, 0.0, 0.5)
    flat, inclined = (drilling_load(Drill(8e-3, inclination=angle), 0.2e-3, force, force) for angle in (0.0, -0.2))
    assert inclined.thrust < flat.thrust
