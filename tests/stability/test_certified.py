"""Certified limits: verified by multipliers, the same for every largest depth, never infinite without a proof."""

import numpy as np
import pytest
from benchmarks_of_literature import HALF_DOWN, RPM, benchmark_cut, one_degree_of_freedom

from millfrf.cutting import MillingProcess
from millfrf.stability import StabilityLobes, certified_lobes, collocation, multipliers, nyquist_limits, zero_order
from millfrf.stability import certification as certified
from millfrf.stability.lobes_result import StabilityLimits
from modal_fit import ModalModel
from replay_data import table_one_model

SLOT = MillingProcess(4, 0.0127, np.pi / 2, 700e6, 0.17, 0.33, 0.0, np.pi, 1e-4)
SPEEDS = np.array([510.0, 528.0, 545.0]) * RPM


def test_a_robot_in_a_slot_is_verified_at_every_speed_whatever_the_largest_depth() -> None:
    result = [certified_lobes(table_one_model(), SLOT, SPEEDS, deepest) for deepest in (0.0003, 0.005, 0.024)]
    for lobes in result:
        assert lobes.status == ("verified",) * len(SPEEDS)
        np.testing.assert_allclose(lobes.depth_limits, result[0].depth_limits, rtol=1e-6)
        assert lobes.method == "collocation"


def test_no_limit_is_verified_up_to_the_largest_depth() -> None:
    lobes = certified_lobes(table_one_model(), HALF_DOWN, SPEEDS, 1e-3)
    assert np.isinf(lobes.depth_limits).all()
    assert set(lobes.status) == {"verified"}
    assert set(lobes.bifurcations) == {"none"}


def _with_limits(lobes: StabilityLobes, depths: np.ndarray) -> StabilityLimits:
    """The solver's answer with other depths: what a faulty search would give."""
    finite = np.flatnonzero(np.isfinite(depths))
    return StabilityLimits(
        lobes.spindle_speeds, 0.024, finite, depths[finite], np.full(len(finite), 17.0), ("hopf",) * len(finite),
        np.full(len(finite), 2), np.zeros(len(finite)), "collocation",
    )  # fmt: skip


@pytest.mark.parametrize("share", [np.inf, 5.0, 1.01, 0.99, 0.5])
def test_a_wrong_limit_is_found_out_and_put_right(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """None at all, too high, or too low: the multipliers say so, and the limit is looked for again."""
    right = collocation(table_one_model(), SLOT, SPEEDS, 0.024)
    wrong = _with_limits(right, share * right.depth_limits)
    monkeypatch.setattr(certified, "lowest_limits", lambda *_: wrong)
    lobes = certified_lobes(table_one_model(), SLOT, SPEEDS, 0.024)
    assert set(lobes.status) == {"verified"}
    np.testing.assert_allclose(lobes.depth_limits, right.depth_limits, rtol=1e-5)
    np.testing.assert_allclose(lobes.chatter_frequencies, right.chatter_frequencies, rtol=1e-3)
    assert lobes.bifurcations == right.bifurcations


def test_what_no_second_discretisation_confirms_is_a_lower_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    right = collocation(table_one_model(), SLOT, SPEEDS[:1], 0.024)
    wrong = _with_limits(right, np.array([np.inf]))
    monkeypatch.setattr(certified, "lowest_limits", lambda *_: wrong)
    monkeypatch.setattr("millfrf.stability.certification._confirmed", lambda *_: False)
    lobes = certified_lobes(table_one_model(), SLOT, SPEEDS[:1], 0.024)
    assert lobes.status == ("lower-bound",)
    assert 0.9 * right.depth_limits[0] < lobes.depth_limits[0] < right.depth_limits[0]
    assert multipliers(table_one_model(), SLOT, float(SPEEDS[0]), float(lobes.depth_limits[0])).stable
    assert "1 have a lower bound only" in lobes.warnings[-1]


def test_cells_that_were_not_resolved_reach_the_result_as_a_lower_bound() -> None:
    limits = _with_limits(collocation(table_one_model(), SLOT, SPEEDS[:2], 0.024), np.array([np.inf, 1e-3]))
    known = StabilityLimits(**(limits.__dict__ | {"resolved": np.array([2e-4, np.inf])})).lowest()
    assert known.status == ("lower-bound", "not-verified")
    np.testing.assert_allclose(known.depth_limits, [2e-4, 1e-3])
    assert "1 of 2 speeds" in known.warnings[-1]


def _helical() -> tuple[ModalModel, MillingProcess]:
    plain = benchmark_cut(0.5, "down")
    return one_degree_of_freedom(), MillingProcess(**(plain.__dict__ | {"helix_angle": 0.5}))


def test_a_helical_cut_is_verified_and_does_not_depend_on_the_largest_depth() -> None:
    model, process = _helical()
    speeds = np.array([8000.0, 20000.0]) * RPM
    first, other = (certified_lobes(model, process, speeds, deepest) for deepest in (0.004, 0.02))
    assert set(first.status) == {"verified"}
    np.testing.assert_allclose(first.depth_limits, other.depth_limits, rtol=1e-4)


def _low_immersion() -> MillingProcess:
    return MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi - np.arccos(0.98), np.pi, 1.5e-4)


def test_an_frf_alone_is_not_verified_and_its_stated_error_is_told() -> None:
    """a/D = 0.01: the FRF's band ends before the harmonics do; the stated error holds the true one."""
    speeds = np.array([900.0, 2000.0]) * RPM
    exact = certified_lobes(table_one_model(), _low_immersion(), speeds, 0.1)
    lobes = certified_lobes(table_one_model().frf(np.arange(2.0, 80.0, 0.125)), _low_immersion(), speeds, 0.1)
    assert set(exact.status) == {"verified"}
    assert lobes.numerics == ("not-verified",) * 2
    assert lobes.band == ("unmeasured",) * 2
    stated = [line for line in lobes.warnings if "stated error is up to" in line]
    share = float(stated[0].split("up to ")[1].split("%")[0]) / 100
    assert np.abs(lobes.depth_limits / exact.depth_limits - 1).max() < share < 0.1
    assert any("above 79.88 Hz, where the FRF ends, are not negligible" in line for line in lobes.warnings)


def test_speeds_too_slow_for_an_frf_are_unresolved() -> None:
    frf = table_one_model().frf(np.arange(2.0, 80.0, 0.25))
    lobes = certified_lobes(frf, HALF_DOWN, np.array([5.0, 1200.0]) * RPM, 0.006)
    assert lobes.numerics == ("unresolved", "not-verified")
    assert np.isnan(lobes.depth_limits[0])
    assert any("too many harmonics" in line for line in lobes.warnings)


def test_averaged_coefficients_are_unsafe_here_and_say_so() -> None:
    """Half-immersion of two teeth at 1050 rpm: the certified limit is a period doubling at three quarters of theirs."""
    speeds = np.array([1050.0]) * RPM
    limit = certified_lobes(table_one_model(), HALF_DOWN, speeds, 0.006)
    assert limit.bifurcations == ("period-doubling",)
    for solver in (zero_order, nyquist_limits):
        lobes = solver(table_one_model(), HALF_DOWN, speeds, 0.006)
        assert lobes.depth_limits[0] > 1.3 * limit.depth_limits[0]
        assert "period doubling is not seen" in lobes.warnings[-1]
