"""Zero-order and Nyquist limits: independent calculations, an analytic case, and each other."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import Frf
from millfrf.core import FileFormatError, InputError
from millfrf.cutting import MillingProcess, average_directional_matrix
from millfrf.stability import StabilityLobes, collocation, nyquist_limits, read_lobes, write_lobes, zero_order
from millfrf.stability.solvers.zero_order import unstable_pole_pairs
from millfrf.stability.tip_receptance import tool_receptance
from modal_fit import ModalModel
from replay_data import table_one_model

HALF_DOWN = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
RPM = 2 * np.pi / 60
# modes of Mohammadi & Ahmadi, Table 1, half-immersion down-milling: limits computed twice independently of millfrf;
# the paper prints curves
TABLE_1_RPM = np.array([800, 900, 1000, 1100, 1200, 1400, 1600, 2000.0])
TABLE_1_MM = np.array([1.64, 1.62, 1.71, 1.86, 2.05, 2.49, 2.99, 4.14])
TABLE_1_HZ = {800: 17.23, 900: 17.36, 1200: 17.76, 1600: 18.24, 2000: 18.62}


@pytest.mark.parametrize("solver", [zero_order, nyquist_limits])
def test_table_1_limits_and_chatter_frequencies(solver) -> None:  # type: ignore[no-untyped-def]
    lobes = solver(table_one_model(), HALF_DOWN, TABLE_1_RPM * RPM, 0.02)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, TABLE_1_MM, rtol=0.01)
    for rpm, frequency in TABLE_1_HZ.items():
        assert lobes.chatter_frequencies[list(TABLE_1_RPM).index(rpm)] == pytest.approx(frequency, abs=0.02)
    assert set(lobes.bifurcations) == {"hopf"}


def single_mode(natural: float, zeta: float, stiffness: float) -> ModalModel:
    """One degree of freedom in X, as a modal model."""
    w = 2 * np.pi * natural
    pole = w * (-zeta + 1j * np.sqrt(1 - zeta**2))
    residue = w**2 / stiffness / (2j * pole.imag)
    return ModalModel(np.array([pole]), np.array([[residue]]), np.array([[1.0 + 0j]]), ("TCP:+X",), ("TCP:+X",))


@settings(max_examples=30)
@given(natural=st.floats(10, 900), zeta=st.floats(0.005, 0.1), ratio=st.floats(0.15, 4.0))
def test_one_mode_against_the_textbook(natural: float, zeta: float, ratio: float) -> None:
    """1 DOF: a = -1 / (2 K alpha Re G) on the part of the FRF with Re G alpha < 0 (Altintas, section 4.5)."""
    model = single_mode(natural, zeta, 1e6)
    process = MillingProcess(2, 0.01, np.pi / 2, 5e8, 0.3, 0.0, 0.0, np.pi / 2, 1e-4)
    alpha = average_directional_matrix(process)[0, 0]
    speed = 2 * np.pi * natural / 2 * ratio
    lobes = zero_order(model, process, np.array([speed]), 1e3)
    w = 2 * np.pi * np.linspace(0.3, 2.9, 400_001) * natural
    receptance = model.receptance(w / (2 * np.pi))[:, 0, 0]
    loop = process.ktc * alpha * receptance * (1 - np.exp(-1j * w * 2 * np.pi / 2 / speed))
    crossings = np.flatnonzero(np.diff(np.sign(loop.imag)))
    gains = loop.real[crossings]
    assert lobes.depth_limits[0] == pytest.approx(1 / gains.max(), rel=2e-3)
    minimum = -1 / (2 * process.ktc * (alpha * receptance).real.min())
    assert lobes.depth_limits[0] >= minimum * (1 - 1e-9)


def test_nyquist_and_zero_order_agree_where_the_limit_is_the_first_instability() -> None:
    speeds = np.linspace(600, 2400, 25) * RPM
    exact = zero_order(table_one_model(), HALF_DOWN, speeds, 0.02)
    counted = nyquist_limits(table_one_model(), HALF_DOWN, speeds, 0.02)
    np.testing.assert_allclose(counted.depth_limits, exact.depth_limits, rtol=2e-3)
    for speed, limit in zip(speeds[::5], exact.depth_limits[::5], strict=True):
        depths = limit * np.array([0.98, 1.02])
        assert unstable_pole_pairs(tool_receptance(table_one_model()), HALF_DOWN, speed, depths).tolist() == [0, 1]


def test_a_measured_frf_gives_the_models_limits_as_its_lines_get_closer() -> None:
    exact = zero_order(table_one_model(), HALF_DOWN, TABLE_1_RPM * RPM, 0.02).depth_limits
    errors = []
    for spacing in (0.25, 0.125, 0.0625):
        frf = table_one_model().frf(np.arange(5.0, 60.0, spacing))
        errors.append(np.abs(zero_order(frf, HALF_DOWN, TABLE_1_RPM * RPM, 0.02).depth_limits / exact - 1).max())
    assert errors[2] < 0.003
    assert errors[0] / errors[2] > 8  # linear interpolation: second order


def test_order_and_sign_of_degrees_of_freedom_do_not_matter() -> None:
    model = table_one_model()
    order = [2, 0, 1]
    sign = np.array([-1.0, 1.0, -1.0])
    turned = ModalModel(
        model.poles,
        model.right[:, order] * sign,
        model.left[:, order] * sign,
        ("TCP:-Z", "TCP:+X", "TCP:-Y"),
        ("TCP:-Z", "TCP:+X", "TCP:-Y"),
    )
    f = np.array([15.0, 17.0, 19.0])
    np.testing.assert_allclose(tool_receptance(turned).evaluate(f), model.receptance(f), rtol=1e-12)


def test_a_depth_beyond_the_largest_asked_for_is_none() -> None:
    lobes = zero_order(table_one_model(), HALF_DOWN, np.array([800, 2000.0]) * RPM, 0.002)
    assert lobes.bifurcations == ("hopf", "none")
    assert np.isinf(lobes.depth_limits[1])
    assert np.isnan(lobes.chatter_frequencies[1])


def test_lobes_survive_their_file(tmp_path: Path) -> None:
    lobes = zero_order(table_one_model(), HALF_DOWN, np.array([800, 2000.0]) * RPM, 0.002)
    write_lobes(tmp_path / "lobes.csv", lobes)
    again = read_lobes(tmp_path / "lobes.csv")
    np.testing.assert_allclose(again.depth_limits, lobes.depth_limits, rtol=1e-6)
    np.testing.assert_allclose(again.spindle_speeds, lobes.spindle_speeds, rtol=1e-9)
    assert again.bifurcations == lobes.bifurcations
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(FileFormatError, match="columns"):
        read_lobes(tmp_path / "other.csv")


def _frf(values: np.ndarray, unit: str = "m/N", quantity: str = "receptance") -> Frf:
    n, labels = len(values), ("TCP:+X",)
    return Frf(np.arange(1.0, n + 1), values, labels, labels, quantity, unit, np.ones(n, dtype=bool))


def _one_mode(pole: complex, response: str) -> ModalModel:
    unity = np.ones((1, 1), dtype=complex)
    return ModalModel(np.array([pole]), unity, unity, (response,), ("T:+X",))


@pytest.mark.parametrize(
    ("structure", "speed", "depth", "message"),
    [
        (table_one_model(), -1.0, 0.01, "must be positive"),
        (table_one_model(), 80.0, -0.01, "largest depth -0.01"),
        (_frf(np.ones((4, 1, 1), dtype=complex)), 80.0, 0.01, "4 valid lines"),
        (_frf(np.ones((20, 1, 1), dtype=complex), unit="m/V", quantity="transfer"), 80.0, 0.01, "transfer in m/V"),
        (
            _one_mode(1 + 5j, "T:+X"),
            80.0,
            0.01,
            "unstable",
        ),
        (
            _one_mode(-1 + 5j, "H:+X"),
            80.0,
            0.01,
            "calibrate",
        ),
    ],
)
def test_absurd_input_is_refused(structure: Frf | ModalModel, speed: float, depth: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        zero_order(structure, HALF_DOWN, np.array([speed]), depth)


def test_columns_of_unequal_length_are_refused() -> None:
    with pytest.raises(InputError, match="unequal lengths"):
        StabilityLobes(np.ones(2), np.ones(2), np.ones(2), ("hopf",), "zero-order")


def test_a_damped_structure_at_high_speed_has_the_limits_of_nyquist_and_collocation() -> None:
    """Its chatter lies far above three times the natural frequency, where the search used to end."""
    poles = 2 * np.pi * np.array([-7.5 + 20.1j])
    shape = np.array([[1.0, 0.4, 0.2]])
    model = ModalModel(poles, shape * (2 * np.pi * 21.4) ** 2 / 1e6 / (2j * poles.imag), shape + 0j, TCP, TCP)
    cut = MillingProcess(4, 0.0127, np.pi / 2, 3e8, 0.3, 0.1, 0.0, np.pi, 1e-4)
    speeds = np.array([3000.0, 4000.0]) * np.pi / 30
    result = zero_order(model, cut, speeds, 0.4)
    assert (result.chatter_frequencies > 3 * 21.4).all()
    np.testing.assert_allclose(result.depth_limits, nyquist_limits(model, cut, speeds, 0.4).depth_limits, rtol=1e-3)
    np.testing.assert_allclose(result.depth_limits, collocation(model, cut, speeds, 0.4).depth_limits, rtol=0.3)


TCP = ("T:+X", "T:+Y", "T:+Z")
