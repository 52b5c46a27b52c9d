"""Receptance coupling: free substructures joined in the frequency domain, rigidly or by springs."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def couple_receptances(
    receptance: Complex, pairs: Sequence[tuple[int, int]], compliance: Sequence[complex] | Complex
) -> Complex:
    """Receptance after the degrees of freedom of each pair were joined by a spring.

    With ``B = [e_a - e_b, ...]``: ``H' = H - H B (B^T H B + diag(compliance))^-1 B^T H``. For one spring this is Chen
    et al. 2026, Eqs. 4-7; compliance 0 joins rigidly (de Klerk, Rixen & Voormeeren 2008, AIAA J. 46, dual assembly).
    A measured or computed FRF block may stand for any substructure, in the plane or in space.

    Parameters
    ----------
    receptance : (n_frequencies, n_dof, n_dof)
        Block-diagonal FRFs of the substructures apart; m/N, m/(N m) = rad/N and rad/(N m).
    pairs
        Degrees of freedom ``(a, b)`` to be joined.
    compliance : (n_pairs,)
        1 / stiffness of each joint, complex with loss; 0: rigid.

    Raises
    ------
    InputError
        Unequal numbers of pairs and compliances, or a degree of freedom that is not there.
    """
    n_dof = receptance.shape[1]
    if len(pairs) != len(compliance):
        raise InputError(f"{len(pairs)} pairs to couple but {len(compliance)} compliances; give one for each")
    if any(not 0 <= dof < n_dof for pair in pairs for dof in pair):
        raise InputError(f"coupling {list(pairs)} names a degree of freedom outside 0 to {n_dof - 1}")
    signs = np.zeros((n_dof, len(pairs)))
    for column, (first, second) in enumerate(pairs):
        signs[first, column] += 1
        signs[second, column] -= 1
    return couple_along(receptance, signs, compliance)


def couple_along(receptance: Complex, directions: Real, compliance: Sequence[complex] | Complex) -> Complex:
    """The same along any directions: each column of ``directions`` (n_dof, n_pairs) is a gap that a spring closes.

    A column may turn degrees of freedom into a joint's axes, hold a rigid link's end, or tie one to the ground.
    """
    columns = receptance @ directions
    gap = directions.T @ columns + np.diag(np.asarray(compliance))
    return np.asarray(receptance - columns @ np.linalg.solve(gap, directions.T @ receptance))


def block_diagonal(blocks: Sequence[Complex]) -> Complex:
    """Receptances of substructures apart, in one matrix (n_frequencies, sum of n_dof, sum of n_dof)."""
    sizes = [block.shape[1] for block in blocks]
    whole = np.zeros((len(blocks[0]), sum(sizes), sum(sizes)), dtype=complex)
    start = 0
    for block, size in zip(blocks, sizes, strict=True):
        whole[:, start : start + size, start : start + size] = block
        start += size
    return whole
