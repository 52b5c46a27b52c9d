"""Products and solutions of small matrices, line by line, against NumPy's."""

import numpy as np
import pytest

from millfrf.mismatch.models.modal_lines import closed_loop, line_products


def _lines(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def test_products_of_matrices_and_vectors() -> None:
    rng = np.random.default_rng(3)
    first, other, vectors = _lines(rng, 6, 2, 3), _lines(rng, 6, 3, 4), _lines(rng, 6, 3)
    np.testing.assert_allclose(line_products(first, other), first @ other, rtol=1e-13)
    np.testing.assert_allclose(line_products(first, vectors), np.einsum("kij,kj->ki", first, vectors), rtol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_closed_loop_is_the_solution_of_its_equations(n: int) -> None:
    rng = np.random.default_rng(n)
    receptance, feedback = _lines(rng, 7, n, 3), _lines(rng, 7, 3, n)
    solved = np.linalg.solve(np.eye(n) + receptance @ feedback, receptance)
    np.testing.assert_allclose(closed_loop(receptance, feedback), solved, rtol=1e-10)


def test_rows_are_exchanged_where_a_pivot_is_zero() -> None:
    receptance = np.array([[[0.0, 1.0], [1.0, 0.0]]], dtype=complex)
    feedback = np.linalg.inv(receptance) @ (np.array([[[0.0, 2.0], [3.0, 1.0]]]) - np.eye(2))
    solved = np.linalg.solve(np.eye(2) + receptance @ feedback, receptance)
    np.testing.assert_allclose(closed_loop(receptance, feedback), solved, rtol=1e-13)


def test_a_singular_loop_is_refused() -> None:
    unity = np.ones((1, 1, 1), dtype=complex)
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        closed_loop(unity, -unity)
