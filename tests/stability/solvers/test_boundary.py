"""Traced boundaries and grids against single speeds solved on their own."""

import numpy as np
import pytest
from benchmarks_of_literature import HALF_DOWN, RPM, benchmark_cut, one_degree_of_freedom

from millfrf.core import InputError
from millfrf.stability import collocation_limits, multipliers
from millfrf.stability.solvers.boundary import stability_grid, trace_boundary
from replay_data import table_one_model


def test_straight_lines_between_traced_points_hold_the_tolerance() -> None:
    """At 60 speeds that were not traced, corners within 1e-4 of a speed left out."""
    boundary = trace_boundary(table_one_model(), HALF_DOWN, 800 * RPM, 2000 * RPM, 0.006, tolerance=1e-3)
    speeds = np.random.default_rng(4).uniform(800, 2000, 60) * RPM
    exact = collocation_limits(table_one_model(), HALF_DOWN, speeds, 0.006).lowest().depth_limits
    lobes = boundary.lobes
    drawn = np.interp(speeds, lobes.spindle_speeds, lobes.depth_limits)
    assert (np.abs(drawn / exact - 1) < 1e-3).mean() >= 58 / 60
    assert boundary.evaluations < 250


def test_the_notch_of_table_1_is_found_without_being_told_where() -> None:
    lobes = trace_boundary(table_one_model(), HALF_DOWN, 900 * RPM, 1400 * RPM, 0.006, tolerance=0.01).lobes
    doubling = np.array(lobes.bifurcations) == "period-doubling"
    assert lobes.spindle_speeds_rpm[doubling].min() == pytest.approx(1036, abs=4)
    assert lobes.spindle_speeds_rpm[doubling].max() == pytest.approx(1079, abs=4)
    at_1050 = np.interp(1050 * RPM, lobes.spindle_speeds, lobes.depth_limits)
    assert at_1050 == pytest.approx(1.36e-3, rel=0.01)
    # followed more finely than every 10 rpm, the notch goes a little deeper a few rpm lower
    deepest = int(np.argmin(np.where(doubling, lobes.depth_limits, np.inf)))
    rate, depth = lobes.spindle_speeds[deepest], lobes.depth_limits[deepest]
    assert 1.31e-3 < depth < 1.36e-3
    assert multipliers(table_one_model(), HALF_DOWN, rate, 0.999 * depth).stable
    assert multipliers(table_one_model(), HALF_DOWN, rate, 1.001 * depth).bifurcation == "period-doubling"


def test_period_doubling_islands_are_traced_as_islands() -> None:
    """Down-milling at a/D = .05: unstable below a depth above which it is stable again."""
    limits = trace_boundary(
        one_degree_of_freedom(),
        benchmark_cut(0.1, "down"),
        5000 * RPM,
        12000 * RPM,
        0.008,
        tolerance=0.02,
        every_limit=True,
    ).limits
    back = limits.change < 0
    assert back.any()
    assert {limits.bifurcation[row] for row in np.flatnonzero(back)} >= {"period-doubling"}
    doubling = np.array(limits.bifurcation) == "period-doubling"
    checked = 0
    for row in np.flatnonzero(back & doubling)[::7]:
        speed = int(limits.speed[row])
        for begin, end in limits.stable_intervals(speed)[1:]:
            if begin == limits.depth[row] and end > 1.01 * begin:
                cut = benchmark_cut(0.1, "down")
                rate = limits.spindle_speeds[speed]
                assert multipliers(one_degree_of_freedom(), cut, rate, (begin + end) / 2).stable
                assert not multipliers(one_degree_of_freedom(), cut, rate, begin * 0.999).stable
                checked += 1
    assert checked >= 3


def test_a_grid_is_what_multipliers_say_cut_by_cut() -> None:
    speeds, depths = np.linspace(5000, 20000, 7) * RPM, np.linspace(0.0, 0.004, 6)
    grid = stability_grid(one_degree_of_freedom(), benchmark_cut(0.5, "up"), speeds, depths, threads=2)
    for i, speed in enumerate(speeds):
        for j, depth in enumerate(depths):
            single = multipliers(one_degree_of_freedom(), benchmark_cut(0.5, "up"), speed, depth)
            assert grid.unstable_multipliers[i, j] == (np.abs(single.values) > 1).sum()
    assert grid.stable.shape == (7, 6)
    assert grid.stable[:, 0].all()


def test_absurd_ranges_are_refused() -> None:
    model = table_one_model()
    with pytest.raises(InputError, match="not positive and increasing"):
        trace_boundary(model, HALF_DOWN, 200.0, 100.0, 0.006)
    with pytest.raises(InputError, match="tolerance 0 of depth"):
        trace_boundary(model, HALF_DOWN, 100.0, 200.0, 0.006, tolerance=0)
    with pytest.raises(InputError, match=r"depths -0.001 m"):
        stability_grid(model, HALF_DOWN, np.array([100.0]), np.array([-1e-3, 1e-3]))
