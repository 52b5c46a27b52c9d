"""Multi-frequency: the notch from FRF samples alone, convergence to collocation, refusals."""

import numpy as np
import pytest
from benchmarks_of_literature import CONVERGED_MM, HALF_DOWN, RPM, SPEEDS_RPM, benchmark_cut, one_degree_of_freedom

from estimation import Frf
from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import collocation, multi_frequency, zero_order
from millfrf.stability.solvers.multi_frequency import multi_frequency_limits
from modal_fit import ModalModel
from replay_data import table_one_model


def test_the_notch_of_table_1_from_frf_samples_without_a_fit() -> None:
    """Lines every 0.125 Hz, 5 to 60 Hz: period doubling from 1040 to 1070 rpm, 1.36 mm at 1050."""
    frf = table_one_model().frf(np.arange(5.0, 60.0, 0.125))
    speeds = np.array([1000, 1030, 1040, 1050, 1060, 1070, 1080, 1100.0])
    lobes = multi_frequency(frf, HALF_DOWN, speeds * RPM, 0.006)
    assert [kind == "period-doubling" for kind in lobes.bifurcations] == [1040 <= s <= 1070 for s in speeds]
    assert lobes.depth_limits[3] * 1e3 == pytest.approx(1.36, abs=0.01)
    np.testing.assert_allclose(lobes.chatter_frequencies[2:6], speeds[2:6] / 60, rtol=1e-12)


def test_stated_errors_cover_the_distance_to_the_model_where_lines_are_coarse() -> None:
    speeds = np.linspace(850, 2000, 12) * RPM
    limits = multi_frequency_limits(table_one_model().frf(np.arange(2.0, 150.0, 0.25)), HALF_DOWN, speeds, 0.006)
    exact = collocation(table_one_model(), HALF_DOWN, speeds, 0.006).depth_limits
    first = np.unique(limits.speed, return_index=True)[1]
    gap = np.abs(limits.depth[first] - exact)
    assert (gap < 3 * limits.error[first] + 1e-3 * exact).mean() > 0.8


@pytest.mark.parametrize("cut", [(1.0, "slot"), (0.5, "down"), (0.5, "up"), (0.1, "down")])
def test_it_goes_to_the_converged_limits(cut: tuple[float, str]) -> None:
    """Truncated at three times the natural frequency: 0.6 % (short immersions have more harmonics)."""
    lobes = multi_frequency(one_degree_of_freedom(), benchmark_cut(*cut), SPEEDS_RPM[:5] * RPM, 0.005)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, CONVERGED_MM[cut][:5], rtol=6e-3)


def test_one_harmonic_is_the_zero_order_solution() -> None:
    """Tooth passing far above the structure: only the average is left."""
    cut = MillingProcess(3, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, 0.0, np.pi, 0.15e-3)
    speeds = np.array([9000, 20000.0]) * RPM
    average = zero_order(table_one_model(), cut, speeds, 0.2).depth_limits
    np.testing.assert_allclose(multi_frequency(table_one_model(), cut, speeds, 0.2).depth_limits, average, rtol=2e-3)


def _few_lines() -> Frf:
    return table_one_model().frf(np.array([10.0, 20.0, 30.0]))


def _no_lines() -> Frf:
    return table_one_model().frf(np.zeros(0))


@pytest.mark.parametrize(
    ("structure", "rpm", "depth", "message"),
    [
        (_few_lines(), 1000.0, 0.01, "3 valid lines"),
        (_no_lines(), 1000.0, 0.01, "0 valid lines"),
        (table_one_model(), 1000.0, 0.0, "largest depth 0.0"),
        (table_one_model(), -5.0, 0.01, "must be positive"),
        (table_one_model(), 20.0, 0.01, "harmonics of tooth passing"),
    ],
)
def test_absurd_input_is_refused_in_one_line(
    structure: Frf | ModalModel, rpm: float, depth: float, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        multi_frequency(structure, HALF_DOWN, np.array([rpm * RPM]), depth)
    assert "\n" not in str(caught.value)
