"""Collocation: converged limits of the literature, Table 1's notch, and the multipliers themselves."""

import numpy as np
import pytest
from benchmarks_of_literature import (
    CONVERGED_MM,
    HALF_DOWN,
    RPM,
    SPEEDS_RPM,
    benchmark_cut,
    one_degree_of_freedom,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, collocation_limits, lowest_limits, multi_frequency, multipliers
from modal_fit import ModalModel, Residuals
from replay_data import table_one_model


@pytest.mark.parametrize("cut", CONVERGED_MM)
def test_every_converged_limit_to_four_digits(cut: tuple[float, str]) -> None:
    """All printed digits: half a unit of the fifth place, as stated by the errors too."""
    limits = collocation_limits(one_degree_of_freedom(), benchmark_cut(*cut), SPEEDS_RPM * RPM, 0.012)
    np.testing.assert_allclose(limits.lowest().depth_limits * 1e3, CONVERGED_MM[cut], atol=0.6e-5)
    first = np.unique(limits.speed, return_index=True)[1]
    assert (limits.error[first] < 1e-5 * limits.depth[first]).all()


def test_the_spectral_radius_of_the_benchmark_slot() -> None:
    values = multipliers(one_degree_of_freedom(), benchmark_cut(1.0, "slot"), 20000 * RPM, 2e-3)
    assert values.spectral_radius == pytest.approx(1.17807, abs=0.6e-5)
    assert not values.stable
    assert values.bifurcation == "period-doubling"


TABLE_1_RPM = np.array([800, 900, 1200, 1600, 2000.0])


def test_table_1_hopf_limits_with_coefficients_as_they_vary() -> None:
    """Semi-discretisation gives 1.67, 1.72, 2.04, 2.95 and 4.11 mm, two digits after the point."""
    lobes = collocation(table_one_model(), HALF_DOWN, TABLE_1_RPM * RPM, 0.006)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, [1.67, 1.72, 2.04, 2.95, 4.11], rtol=0.01)
    assert set(lobes.bifurcations) == {"hopf"}
    assert lobes.chatter_frequencies[1] == pytest.approx(17.36, abs=0.1)


def test_table_1_period_doubling_notch() -> None:
    """1040 to 1070 rpm, down to 1.36 mm near 1050; the vibration is at half the tooth passing frequency."""
    speeds = np.array([1000, 1030, 1040, 1050, 1060, 1070, 1080, 1090.0])
    lobes = collocation(table_one_model(), HALF_DOWN, speeds * RPM, 0.006)
    inside = (speeds >= 1040) & (speeds <= 1070)
    assert [kind == "period-doubling" for kind in lobes.bifurcations] == inside.tolist()
    assert lobes.depth_limits.min() * 1e3 == pytest.approx(1.36, abs=0.01)
    assert speeds[np.argmin(lobes.depth_limits)] == 1050
    np.testing.assert_allclose(lobes.chatter_frequencies[inside], speeds[inside] / 60, rtol=1e-12)


@pytest.mark.parametrize(
    ("rpm", "depth", "stable"),
    [(800, 1.5, True), (800, 2, False), (900, 1.5, True), (900, 2, False), (1200, 2, True), (1100, 0.5, True)],
)
def test_the_papers_cuts_are_on_the_right_side(rpm: float, depth: float, stable: bool) -> None:
    assert multipliers(table_one_model(), HALF_DOWN, rpm * RPM, depth * 1e-3).stable == stable


@pytest.mark.parametrize("rpm", [1600, 2000])
def test_chatter_only_above_3_mm_at_the_two_highest_speeds(rpm: float) -> None:
    assert multipliers(table_one_model(), HALF_DOWN, rpm * RPM, 2.9e-3).stable
    assert not multipliers(table_one_model(), HALF_DOWN, rpm * RPM, 4.2e-3).stable


def test_the_paper_period_doubled_at_2_5_mm_just_above_the_notch() -> None:
    """At 1100 rpm the model loses stability by Hopf; its notch lies 30 rpm lower than the recorded one."""
    assert not multipliers(table_one_model(), HALF_DOWN, 1100 * RPM, 2.5e-3).stable
    doubled = multipliers(table_one_model(), HALF_DOWN, 1060 * RPM, 2.5e-3)
    assert doubled.bifurcation == "period-doubling"


TWO_BY_TWO = MillingProcess(2, 0.03175, np.pi / 2, 1319.4e6, 788.8 / 1319.4, 0.0, np.pi / 2, np.pi, 1e-4)


def two_by_two() -> ModalModel:
    """2-direction case with two modes each (456.780/1448.889 Hz and 516.518/1408.448 Hz)."""
    natural = 2 * np.pi * np.array([456.780, 1448.889, 516.518, 1408.448])
    zeta = np.array([0.11171, 0.01704, 0.02458, 0.03136])
    stiffness = np.array([7.9331e6, 14.6918e6, 9.3746e6, 12.4064e6])
    poles = natural * (-zeta + 1j * np.sqrt(1 - zeta**2))
    direction = np.array([[1, 0], [1, 0], [0, 1], [0, 1.0]])
    right = direction * (natural**2 / stiffness / (2j * poles.imag))[:, None]
    return ModalModel(poles, right, direction + 0j, ("TCP:+X", "TCP:+Y"), ("TCP:+X", "TCP:+Y"))


@settings(max_examples=12)
@given(
    rpm=st.floats(3000, 20000),
    start=st.floats(0, 2.0),
    width=st.floats(0.3, 3.0),
    teeth=st.integers(1, 5),
    share=st.floats(0.02, 0.98),
)
def test_limits_and_multipliers_agree_at_any_depth(
    rpm: float, start: float, width: float, teeth: int, share: float
) -> None:
    """Multipliers counted outside the circle equal what the crossings say, islands and several teeth included."""
    cut = MillingProcess(teeth, 0.01, np.pi / 2, 6e8, 1 / 3, 0.0, start, min(start + width, np.pi), 1e-4)
    limits = collocation_limits(two_by_two(), cut, np.array([rpm * RPM]), 0.02)
    depth = share * 0.02
    if len(limits.depth) and np.abs(limits.depth / depth - 1).min() < 1e-3:
        return
    outside = int((np.abs(multipliers(two_by_two(), cut, rpm * RPM, depth).values) > 1).sum())
    assert limits.unstable_multipliers(np.array([depth]))[0, 0] == outside


def test_kind_and_frequency_are_those_of_the_multiplier_at_the_limit() -> None:
    speeds = np.linspace(4000, 24000, 9) * RPM
    limits = collocation_limits(two_by_two(), TWO_BY_TWO, speeds, 0.02)
    for speed, depth, frequency, kind in zip(
        limits.speed, limits.depth, limits.frequency, limits.bifurcation, strict=True
    ):
        values = multipliers(two_by_two(), TWO_BY_TWO, speeds[speed], depth)
        on_circle = values.values[np.argmin(np.abs(np.abs(values.values) - 1))]
        assert abs(on_circle) == pytest.approx(1, abs=1e-6)
        turns = frequency * values.tooth_period
        assert np.cos(2 * np.pi * turns) == pytest.approx(on_circle.real, abs=1e-5)
        assert kind == ("period-doubling" if abs(turns % 1 - 0.5) < 1e-6 else "hopf")


def test_turning_the_whole_machine_changes_nothing() -> None:
    """Units: twice the stiffness in structure and process, same limits."""
    model = table_one_model()
    soft = ModalModel(model.poles, model.right / 2, model.left, model.responses, model.excitations)
    hard = MillingProcess(2, 0.0127, np.pi / 2, 238e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
    speeds = TABLE_1_RPM * RPM
    single = collocation(model, HALF_DOWN, speeds, 0.006).depth_limits
    np.testing.assert_allclose(collocation(soft, hard, speeds, 0.006).depth_limits, single, rtol=1e-8)


def test_a_residual_flexibility_is_a_mode_far_above() -> None:
    """Its limit is that of a model in which the flexibility is a real mode of rising frequency."""
    base, flexibility = one_degree_of_freedom(), 2e-8
    lower = np.zeros((1, 1))
    static = ModalModel(
        base.poles, base.right, base.left, base.responses, base.excitations,
        residuals=Residuals(np.array([[flexibility]]), lower),
    )  # fmt: skip
    cut, speeds = benchmark_cut(0.5, "down"), SPEEDS_RPM[:3] * RPM
    wanted = collocation(static, cut, speeds, 0.006).depth_limits
    gaps = []
    for natural in (8e3, 16e3):
        turn = 2 * np.pi * natural
        pole = turn * (-0.5 + 1j * np.sqrt(0.75))
        right = np.array([base.right[0], [turn**2 * flexibility / (2j * pole.imag)]])
        real = ModalModel(
            np.array([base.poles[0], pole]), right, np.ones((2, 1)) + 0j, base.responses, base.excitations
        )
        gaps.append(np.abs(collocation(real, cut, speeds, 0.006).depth_limits / wanted - 1).max())
    assert gaps[1] < 0.6 * gaps[0]
    assert gaps[1] < 0.02


def _unstable() -> ModalModel:
    unity = np.ones((1, 1), dtype=complex)
    return ModalModel(np.array([1 + 5j]), unity, unity, ("TCP:+X",), ("TCP:+X",))


@pytest.mark.parametrize(
    ("structure", "speed", "depth", "message"),
    [
        (_unstable(), 80.0, 0.01, "structure itself is unstable"),
        (table_one_model(), 0.0, 0.01, "must be positive"),
        (table_one_model(), 80.0, -0.01, "largest depth -0.01"),
        (table_one_model(), 80.0, np.nan, "largest depth nan"),
        (table_one_model().frf(np.linspace(5, 60, 99)), 80.0, 0.01, "needs a modal model"),
        (table_one_model(), 0.05, 0.01, "turn too often"),
    ],
)
def test_absurd_input_is_refused_in_one_line(structure: ModalModel, speed: float, depth: float, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        collocation_limits(structure, HALF_DOWN, np.array([speed]), depth)
    assert "\n" not in str(caught.value)


def test_a_negative_depth_and_a_standing_spindle_are_refused() -> None:
    with pytest.raises(InputError, match=r"depth = -0.001 m"):
        multipliers(table_one_model(), HALF_DOWN, 80.0, -1e-3)
    with pytest.raises(InputError, match=r"spindle speed 0.0"):
        multipliers(table_one_model(), HALF_DOWN, 0.0, 1e-3)


@pytest.mark.parametrize("deepest", [4e-3, 12e-3, 50e-3])
def test_the_lowest_limit_alone_is_the_lowest_of_all(deepest: float) -> None:
    """Whatever the largest depth is, in a slot and where islands lie above."""
    speeds = np.linspace(5000, 25000, 41) * RPM
    for cut in (benchmark_cut(1.0, "slot"), benchmark_cut(0.05, "down")):
        wanted = collocation_limits(one_degree_of_freedom(), cut, speeds, 0.012).lowest()
        result = lowest_limits(one_degree_of_freedom(), cut, speeds, deepest, threads=2).lowest()
        known = wanted.depth_limits < min(deepest, 0.012)
        np.testing.assert_allclose(result.depth_limits[known], wanted.depth_limits[known], rtol=1e-8)
        np.testing.assert_allclose(result.chatter_frequencies[known], wanted.chatter_frequencies[known], rtol=1e-8)
        assert (result.depth_limits[~known] > min(deepest, 0.012)).all()


FOUR_FLUTE_SLOT = MillingProcess(4, 0.0127, np.pi / 2, 700e6, 0.17, 0.33, 0.0, np.pi, 1e-4)


@pytest.mark.parametrize("deepest", [0.0003, 0.001, 0.005, 0.024])
def test_two_period_doublings_that_nearly_coincide_are_found(deepest: float) -> None:
    """Tooth passing is two thirds of twice a natural frequency there; multi-frequency has 0.10 to 0.11 mm."""
    speeds = np.linspace(500, 560, 61) * RPM
    result = collocation(table_one_model(), FOUR_FLUTE_SLOT, speeds, deepest)
    peer = multi_frequency(table_one_model(), FOUR_FLUTE_SLOT, speeds, 0.0003)
    np.testing.assert_allclose(result.depth_limits, peer.depth_limits, rtol=2e-3)
    assert set(result.status) == {"not-verified"}


def test_the_slot_has_the_limits_that_eigenvalues_say() -> None:
    """Deep in a slow slot the series over a whole period would cancel; multipliers know nothing of series."""
    cut, depths = benchmark_cut(1.0, "slot"), np.linspace(2e-4, 5e-3, 14)
    for rpm in (3000.0, 5200.0, 9000.0):
        limits = collocation_limits(one_degree_of_freedom(), cut, np.array([rpm * RPM]), 5e-3)
        counted = limits.unstable_multipliers(depths)[0]
        for depth, count in zip(depths, counted, strict=True):
            values = multipliers(one_degree_of_freedom(), cut, rpm * RPM, depth, extra_nodes=10).values
            assert (np.abs(values) > 1).sum() == count
        assert (limits.error < 1e-6 * limits.depth).all()


def test_where_rounding_leaves_nothing_of_the_series_eigenvalues_are_taken() -> None:
    """3000 rpm, 12 mm: some 18 times the limit, multipliers up to 4e4."""
    cut, depths = benchmark_cut(1.0, "slot"), np.linspace(5e-4, 12e-3, 12)
    limits = collocation_limits(one_degree_of_freedom(), cut, np.array([3000.0, 9000.0]) * RPM, 12e-3)
    counted = limits.unstable_multipliers(depths)
    for row, rpm in enumerate((3000.0, 9000.0)):
        for depth, count in zip(depths, counted[row], strict=True):
            values = multipliers(one_degree_of_freedom(), cut, rpm * RPM, depth, extra_nodes=15).values
            near = np.abs(limits.depth[limits.speed == row] / depth - 1).min() < 0.02
            assert near or (np.abs(values) > 1).sum() == count
