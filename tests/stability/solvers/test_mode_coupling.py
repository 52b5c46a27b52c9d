"""Mode coupling: the undamped two-mode system has its limit in closed form."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, average_directional_matrix
from millfrf.stability import mode_coupling_limit
from modal_fit import ModalModel

CUT = MillingProcess(2, 0.0127, np.pi / 2, 2e8, 0.3, 0.0, np.pi / 2, np.pi, 1e-4)


def _two_modes(stiff: float, soft: float, turned: float, decay: float) -> ModalModel:
    """Unit mass in X and Y on two springs (N/m) whose axes are turned by an angle (rad), equal decay (1/s) of both.

    Unequal small damping would bring the limit down, as in Ziegler's paradox.
    """
    poles, right, left = [], [], []
    for stiffness, angle in ((stiff, turned), (soft, turned + np.pi / 2)):
        pole = -decay + 1j * np.sqrt(stiffness)
        shape = np.array([np.cos(angle), np.sin(angle)])
        poles.append(pole)
        right.append(shape / (2j * pole.imag))
        left.append(shape + 0j)
    labels = ("T:+X", "T:+Y")
    return ModalModel(np.array(poles), np.array(right), np.array(left), labels, labels)


@given(
    soft=st.floats(2e4, 8e4),
    ratio=st.floats(1.02, 1.6),
    turned=st.floats(0, np.pi),
)
def test_limit_of_two_undamped_modes_is_where_their_frequencies_meet(soft: float, ratio: float, turned: float) -> None:
    """``x'' = -(K - a K_tc alpha) x``: its two eigenvalues are real until the discriminant changes sign."""
    model = _two_modes(soft * ratio, soft, turned, 1e-6)
    c, s = np.cos(turned), np.sin(turned)
    rotation = np.array([[c, -s], [s, c]])
    stiffness = rotation @ np.diag([soft * ratio, soft]) @ rotation.T
    cutting = CUT.ktc * average_directional_matrix(CUT)[:2, :2]

    def entry(i: int, j: int) -> np.poly1d:
        return np.poly1d([-cutting[i, j], stiffness[i, j]])

    roots = ((entry(0, 0) - entry(1, 1)) ** 2 + 4 * entry(0, 1) * entry(1, 0)).roots
    assume(np.abs(roots.imag).max() == 0)
    assume((roots > 0).any())
    expected = float(roots[roots > 0].real.min())
    total = stiffness - expected * cutting
    assume(np.trace(total) > 0)
    assume(1e-5 < expected < 5e-4)
    assume(np.diff(np.sort(roots))[0] > 1e-5)
    result = mode_coupling_limit(model, CUT, 6e-4)
    assert result.depth == pytest.approx(expected, rel=1e-3)
    assert result.kind == "hopf"
    assert result.frequency == pytest.approx(np.sqrt(np.trace(total) / 2) / (2 * np.pi), rel=1e-3)


def test_damping_raises_the_limit_and_equal_axes_alone_do_not_couple() -> None:
    light, heavy = (mode_coupling_limit(_two_modes(5.5e4, 5e4, 0.6, decay), CUT, 5e-3) for decay in (0.02, 12.0))
    assert light.depth < heavy.depth


def test_refusals() -> None:
    model = _two_modes(5.5e4, 5e4, 0.6, 2.0)
    with pytest.raises(InputError, match="largest depth -1"):
        mode_coupling_limit(model, CUT, -1.0)
