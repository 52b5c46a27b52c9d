"""Printed equations that lost a sign, a factor or an order of symbols: what is right, and that the program has it."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.cutting import MillingProcess, average_directional_matrix
from millfrf.robot_model.dynamic_stiffness import couple_receptances
from millfrf.robot_model.finite_elements.structure import rayleigh_constants


def test_damping_ratio_of_mousavi_has_its_constants_swapped() -> None:
    """Eq. 11 prints ``(a w + b / w) / 2``; ``C = a M + b K`` gives ``(a / w + b w) / 2``: 6.5 % twice."""
    a, b = rayleigh_constants((5.9, 8.2), (0.065, 0.065))
    for hertz in (5.9, 8.2):
        omega = 2 * pi * hertz
        mass, stiffness = 3.0, 3.0 * omega**2
        damping = a * mass + b * stiffness
        ratio = damping / (2 * np.sqrt(mass * stiffness))
        assert ratio == pytest.approx(0.065)
        assert (a / omega + b * omega) / 2 == pytest.approx(ratio)
        assert (a * omega + b / omega) / 2 > 30  # as printed


@given(st.floats(0.0, 1.5), st.floats(0.1, 1.6), st.floats(0.0, 0.9), st.integers(1, 6))
def test_directional_coefficients_of_mousavi(start: float, width: float, r: float, teeth: int) -> None:
    """The four of section 4 between the angles of entry and exit, ``D_0 = N / 2 pi [[xx, xy], [yx, yy]]``.

    Their force is ``K_c D_0 b / 2``: half of D_0 is our matrix. (Altintas, Manufacturing Automation, Eq. 3.73.)
    """

    def coefficients(phi: float) -> np.ndarray:
        return np.array(
            [
                [cos(2 * phi) - 2 * r * phi + r * sin(2 * phi), -sin(2 * phi) - 2 * phi + r * cos(2 * phi)],
                [-sin(2 * phi) + 2 * phi + r * cos(2 * phi), -cos(2 * phi) - 2 * r * phi - r * sin(2 * phi)],
            ]
        )

    expected = teeth / (2 * pi) * (coefficients(start + width) - coefficients(start)) / 2 / 2
    process = MillingProcess(teeth, 0.02, pi / 2, 700e6, r, 0.0, start, start + width, 1e-4)
    assert average_directional_matrix(process)[:2, :2] == pytest.approx(expected, abs=1e-12)


def test_coupled_frf_of_chen() -> None:
    """Eq. 7 from Eq. 6 in numbers: ``H = (I - H_0 K)^-1 H_0`` with ``K = [[-k, k], [k, -k]]`` between 1 and 2."""
    rng = np.random.default_rng(2)
    first = rng.normal(size=(1, 1)) + 1j * rng.normal(size=(1, 1))
    second = rng.normal(size=(2, 2)) + 1j * rng.normal(size=(2, 2))
    second = (second + second.T) / 2
    k = 0.7
    apart = np.zeros((3, 3), dtype=complex)
    apart[:1, :1], apart[1:, 1:] = first, second
    spring = np.array([[-k, k, 0], [k, -k, 0], [0, 0, 0]])
    expected = np.linalg.solve(np.eye(3) - apart @ spring, apart)
    h11, h22, h23, h33 = first[0, 0], second[0, 0], second[0, 1], second[1, 1]
    whole = 1 + k * (h11 + h22)
    assert expected[0, 0] == pytest.approx(h11 * (1 + k * h22) / whole)  # Eq. 7 with its signs put back
    assert expected[0, 2] == pytest.approx(h11 * k * h23 / whole)
    assert expected[2, 2] == pytest.approx((h33 + k * (h11 * h33 + h22 * h33 - h23**2)) / whole)
    result = couple_receptances(apart[None], [(0, 1)], [1 / k])[0]
    assert result == pytest.approx(expected)
