"""Auto-MAC, phase measures and complexity of shapes in closed form."""

import numpy as np
import pytest

from millfrf.core import InputError
from modal_fit import ModalModel, mode_shapes
from modal_fit.shapes import mode_complexity


def model(right: np.ndarray, n_excitations: int = 1) -> ModalModel:
    n, points = right.shape
    dofs = tuple(f"{k}:+Z" for k in range(points))
    poles = 2 * np.pi * (10 + 7 * np.arange(n)) * (-0.01 + 1j)
    return ModalModel(poles, right + 0j, right[:, :n_excitations] + 0j, dofs, dofs[:n_excitations])


def test_a_real_mode_in_any_phase_is_real() -> None:
    shapes = np.random.default_rng(1).uniform(-1, 1, (3, 9)) * np.exp(1j * np.array([[0.0], [1.1], [2.9]]))
    result = mode_shapes(model(shapes))
    np.testing.assert_allclose(result.collinearity, 1.0)
    np.testing.assert_allclose(result.deviation, 0.0, atol=1e-7)
    np.testing.assert_allclose(result.complexity, 0.0, atol=1e-9)
    np.testing.assert_allclose(result.vectors.imag, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(result.vectors).max(axis=1), 1.0)


def test_a_travelling_wave_covers_the_circle_and_an_ellipse_its_share() -> None:
    turn = np.exp(2j * np.pi * np.arange(720) / 720)
    ellipse = turn.real + 0.25j * turn.imag
    result = mode_complexity(np.array([turn, ellipse, ellipse * 3 * np.exp(0.7j)]))
    np.testing.assert_allclose(result, [1.0, 0.25, 0.25], rtol=1e-4)
    measured = mode_shapes(model(np.array([turn, ellipse])))
    # components spread evenly: (l1 - l2)^2 / (l1 + l2)^2 with l2 / l1 = 1 and 1/16
    np.testing.assert_allclose(measured.collinearity, [0.0, (15 / 17) ** 2], atol=1e-9)


def test_a_known_angle_between_two_halves_is_the_phase_deviation() -> None:
    """Half of the points 20 degrees off the line, half 20 degrees below it."""
    vector = np.concatenate([np.full(4, np.exp(1j * np.radians(20))), np.full(4, -np.exp(-1j * np.radians(20)))])
    result = mode_shapes(model(vector[None]))
    assert np.degrees(result.deviation[0]) == pytest.approx(20.0)


def test_alike_modes_are_named_and_the_longer_side_is_taken() -> None:
    rng = np.random.default_rng(2)
    shapes = rng.uniform(-1, 1, (3, 20))
    shapes[2] = shapes[0] + 0.05 * rng.standard_normal(20)
    result = mode_shapes(model(shapes))
    assert result.alike() == ((0, 2),)
    assert result.most_alike(0) is not None
    assert result.most_alike(0)[0] == 2  # type: ignore[index]
    made = model(shapes)
    turned = ModalModel(made.poles, made.left, made.right, made.excitations, made.responses)
    other = mode_shapes(turned)
    assert (result.side, other.side) == ("right", "left")
    np.testing.assert_allclose(other.assurance, result.assurance)


def test_one_point_has_no_shape() -> None:
    with pytest.raises(InputError, match="a shape needs two or more"):
        mode_shapes(model(np.ones((1, 1))))
