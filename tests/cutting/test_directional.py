"""Directional coefficients: published average, closed form against quadrature, power balance, cutting files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import FileFormatError, InputError
from millfrf.cutting import (
    MillingProcess,
    average_directional_matrix,
    chip_direction,
    directional_harmonics,
    directional_matrix,
    force_direction,
    read_cutting_process,
)

HALF_DOWN = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
TOML = """[cutting]
teeth = 2
diameter_m = 0.0127
edge_angle_deg = 90.0
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.15e-3
"""


def test_average_matrix_of_the_half_immersion_down_milling_of_table_1() -> None:
    published = [[0.117, -0.223, 0.0], [0.277, -0.202, 0.0], [-0.105, 0.105, 0.0]]
    np.testing.assert_allclose(average_directional_matrix(HALF_DOWN), published, atol=6e-4)


@given(
    gamma=st.floats(0.1, np.pi / 2),
    start=st.floats(0, 3.0),
    width=st.floats(0.05, 3.1),
    krc=st.floats(0, 1),
    kac=st.floats(-0.5, 0.5),
    teeth=st.integers(1, 6),
)
def test_closed_form_average_equals_quadrature(
    gamma: float, start: float, width: float, krc: float, kac: float, teeth: int
) -> None:
    process = MillingProcess(teeth, 0.01, gamma, 1e8, krc, kac, start, min(start + width, np.pi), 1e-4)
    node, weight = np.polynomial.legendre.leggauss(40)
    half = (process.exit_angle - process.start_angle) / 2
    phi = process.start_angle + half * (node + 1)
    product = force_direction(process, phi)[:, :, None] * chip_direction(process, phi)[:, None, :]
    expected = teeth / (2 * np.pi) * half * np.einsum("n,nij->ij", weight, product)
    np.testing.assert_allclose(average_directional_matrix(process), expected, rtol=1e-10, atol=1e-13)


def test_matrix_is_periodic_over_a_tooth_and_sums_engaged_teeth() -> None:
    slot = MillingProcess(4, 0.01, np.pi / 3, 1e8, 0.3, 0.2, 0.0, np.pi, 1e-4)
    angles = np.linspace(0, 2 * np.pi, 37)
    here, next_tooth = directional_matrix(slot, angles + 0.01), directional_matrix(slot, angles + 0.01 + np.pi / 2)
    np.testing.assert_allclose(here, next_tooth, atol=1e-12)
    fine = (np.arange(20_000) + 0.5) * np.pi / 2 / 20_000
    np.testing.assert_allclose(directional_matrix(slot, fine).mean(axis=0), average_directional_matrix(slot), atol=1e-7)


@given(phi=st.floats(0, np.pi), gamma=st.floats(0.1, np.pi / 2), krc=st.floats(0.05, 1))
def test_radial_force_opposes_the_chip_normal(phi: float, gamma: float, krc: float) -> None:
    """With tangential and radial parts only, force along the chip normal is exactly -k_rc, whatever the edge angle."""
    process = MillingProcess(1, 0.01, gamma, 1e8, krc, 0.0, 0.0, np.pi, 1e-4)
    angle = np.array([phi])
    along_normal = force_direction(process, angle)[0] @ chip_direction(process, angle)[0]
    assert along_normal == pytest.approx(-krc, abs=1e-12)


def test_cutting_file_reads_to_the_same_process(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(TOML)
    read = read_cutting_process(path)
    assert read.exit_angle == pytest.approx(np.pi)
    np.testing.assert_allclose(average_directional_matrix(read), average_directional_matrix(HALF_DOWN), rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "error", "message"),
    [
        ("teeth = 2", "teeth = 0", InputError, "teeth = 0"),
        ("teeth = 2", "teeth = 2.5", FileFormatError, "cutting.teeth"),
        ("teeth = 2", "", FileFormatError, "cutting.teeth is missing"),
        ("krc = 0.17", "krc_typo = 0.17", FileFormatError, "cutting.krc"),
        ("krc = 0.17", "krc = nan", FileFormatError, "cutting.krc"),
        ("exit_angle_deg = 180.0", "exit_angle_deg = 30.0", InputError, "90 to 30 deg"),
        ("diameter_m = 0.0127", "diameter_m = -1", InputError, "diameter = -1.0 must be positive"),
        ("[cutting]", "[milling]", FileFormatError, "no table"),
        ("[cutting]", "[cutting", FileFormatError, "not TOML"),
    ],
)
def test_absurd_cutting_files_are_refused_in_one_line(
    tmp_path: Path, old: str, new: str, error: type[Exception], message: str
) -> None:
    path = tmp_path / "cut.toml"
    path.write_text(TOML.replace(old, new))
    with pytest.raises(error, match=message) as caught:
        read_cutting_process(path)
    assert "\n" not in str(caught.value)


@given(start=st.floats(0, 2.5), width=st.floats(0.2, 3.1), teeth=st.integers(1, 5), gamma=st.floats(0.3, np.pi / 2))
def test_harmonics_are_the_fourier_coefficients_of_the_matrix(
    start: float, width: float, teeth: int, gamma: float
) -> None:
    """Against sums over a tooth period, whose error falls with the step because of the jumps."""
    process = MillingProcess(teeth, 0.01, gamma, 1e8, 0.3, 0.2, start, min(start + width, np.pi), 1e-4)
    count, orders = 20_000, np.array([-3, 0, 1, 7])
    angles = (np.arange(count) + 0.5) * 2 * np.pi / teeth / count
    wave = np.exp(-1j * teeth * orders[:, None] * angles) / count
    expected = np.einsum("kn,nij->kij", wave, directional_matrix(process, angles))
    np.testing.assert_allclose(directional_harmonics(process, orders), expected, atol=4 * teeth / count)
