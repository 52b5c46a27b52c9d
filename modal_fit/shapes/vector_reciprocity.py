"""Reciprocity of a modal model: left against right vectors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import shared_points

from ..models.modal_model import ModalModel
from ..models.shape_measures import modal_assurance, reciprocity_residual


@dataclass(frozen=True)
class ModeReciprocity:
    """Agreement of left and right vectors of each mode on the points that are both excited and measured.

    Parameters
    ----------
    points
        Points that are compared, ``node:axis``.
    assurance : (n_modes,)
        MAC of right and left vector on these points: 1 for a reciprocal structure.
    residual : (n_modes,)
        ``|A - A^T| / |A + A^T|`` of the residue matrix: 0 for a reciprocal structure.
    """

    points: tuple[str, ...]
    assurance: NDArray[np.float64]
    residual: NDArray[np.float64]


def mode_reciprocity(model: ModalModel) -> ModeReciprocity | None:
    """Compare left and right vectors; None with fewer than two shared points, or for a ``transfer``.

    Reciprocity ``A = A^T`` of the residues ``A = right left^T`` makes both vectors parallel.

    Examples
    --------
    >>> dofs = ("A:+X", "A:+Y")
    >>> model = ModalModel(np.array([-1 + 50j]), np.array([[1, 2j]]), np.array([[2, -1j]]), dofs, dofs)
    >>> round(float(mode_reciprocity(model).assurance[0]), 3)
    0.0
    """
    points = shared_points(model.responses, model.excitations)
    if len(points) < 2 or not len(model.poles) or model.quantity == "transfer":
        return None
    right = model.right[:, [point.row for point in points]] * [point.response_sign for point in points]
    left = model.left[:, [point.column for point in points]] * [point.excitation_sign for point in points]
    assurance = np.diag(modal_assurance(right, left)).copy()
    return ModeReciprocity(tuple(point.name for point in points), assurance, reciprocity_residual(model))
