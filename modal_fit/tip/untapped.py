"""Tapped modes under forces along directions that were not tapped, by reciprocity of the tip."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, DegreeOfFreedom, Index, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import Residuals
from ..models.synthesis import derived_covariance, pack_parameters


@dataclass(frozen=True)
class ForceColumns:
    """Where the left vectors along the model's forces come from.

    Parameters
    ----------
    forces
        Forces of the model.
    tapped : (n_forces,), int
        Column of the taps along each force; -1: not tapped.
    response : (n_forces,), int
        Response at the tip along each force; -1: not measured.
    signs, response_signs : (n_forces,)
        -1 where that column or response counts against the force, else 1.
    """

    forces: tuple[str, ...]
    tapped: Index
    response: Index
    signs: Real
    response_signs: Real

    @property
    def untapped(self) -> tuple[str, ...]:
        """Forces that were not tapped."""
        return tuple(name for name, column in zip(self.forces, self.tapped, strict=True) if column < 0)

    @property
    def known(self) -> bool:
        """Check whether every force was tapped, or follows from a measured response and from a tapped direction."""
        both = (self.tapped >= 0) & (self.response >= 0)
        return bool(np.all((self.tapped >= 0) | (self.response >= 0)) and (both.any() or not self.untapped))


def force_columns(forces: tuple[str, ...], tapped: tuple[str, ...], responses: tuple[str, ...]) -> ForceColumns:
    """Find taps and responses along each force of a model, by their axes: each test has one point, the tip.

    Examples
    --------
    >>> columns = force_columns(("TCP:+X", "TCP:+Z"), ("TCP:+X",), ("TCP:-Z", "TCP:+X"))
    >>> columns.untapped, columns.response.tolist(), columns.response_signs.tolist(), columns.known
    (('TCP:+Z',), [1, 0], [1.0, -1.0], True)
    """
    matches = [[_along(force, names) for force in forces] for names in (tapped, responses)]
    (tap_columns, tap_signs), (rows, row_signs) = (zip(*pairs, strict=True) for pairs in matches)
    return ForceColumns(
        forces, np.array(tap_columns), np.array(rows), np.array(tap_signs, float), np.array(row_signs, float)
    )


def _along(force: str, names: tuple[str, ...]) -> tuple[int, float]:
    """Return the first of the names along the axis of a force, and its sign against it; -1 without one."""
    wanted = DegreeOfFreedom.parse(force)
    for number, name in enumerate(names):
        other = DegreeOfFreedom.parse(name)
        if other.axis == wanted.axis:
            return number, wanted.sign * other.sign
    return -1, 1.0


def with_untapped_forces(hammer: ModalModel, columns: ForceColumns, in_process: ModalModel) -> tuple[ModalModel, float]:
    """Return hammer modes with left vectors along all forces of the in-process model, and the error of reciprocity.

    Where both are measured, a reciprocal mode has ``left = c right`` at the tip; c is the least-squares factor over
    the tapped directions, and ``left = c right`` along the others (Maxwell and Betti). A robot is reciprocal to some
    per cent: the same rule on the in-process modes at the tip, whose left vectors are measured, shows by how much, and
    this rms, as a share of the vector's size, is the standard error of what the rule adds.

    Parameters
    ----------
    hammer
        Modes of the taps with their motion at the tip in the first rows of the right vectors.
    columns
        Taps and responses along the forces.
    in_process
        Modes of the cut at the tip.
    """
    completed = _completed(hammer, columns)
    added = columns.tapped < 0
    rule = _by_reciprocity(in_process.right, in_process.left, columns)
    size = np.linalg.norm(rule, axis=1)[:, None]
    share = float(np.sqrt(np.mean((np.abs(in_process.left - rule) / size)[:, added] ** 2)))
    covariance = derived_covariance(hammer, lambda m: pack_parameters(_completed(m, columns)))
    if covariance is not None:
        own = np.zeros((len(hammer.poles), len(columns.forces)))
        lefts = _by_reciprocity(completed.right, completed.left, columns)
        own[:, added] = (share * np.linalg.norm(lefts, axis=1)[:, None]) ** 2 / 2  # of the real and imaginary part
        start = 2 * (len(completed.poles) + completed.right.size)
        covariance[np.arange(start, len(covariance)), np.arange(start, len(covariance))] += np.tile(own.ravel(), 2)
    return replace(completed, covariance=covariance), share


def _completed(hammer: ModalModel, columns: ForceColumns) -> ModalModel:
    """Return the modes with a left vector along every force, without covariance."""
    measured = columns.tapped >= 0
    left = np.zeros((len(hammer.poles), len(columns.forces)), dtype=complex)
    left[:, measured] = hammer.left[:, columns.tapped[measured]] * columns.signs[measured]
    left = np.where(measured, left, _by_reciprocity(hammer.right, left, columns))
    return replace(hammer, left=left, excitations=columns.forces, residuals=None, covariance=None)


def _by_reciprocity(right: Complex, left: Complex, columns: ForceColumns) -> Complex:
    """Return ``c right`` along every force, with c from the forces that were tapped and whose response was measured."""
    along = np.where(columns.response >= 0, right[:, columns.response] * columns.response_signs, 0.0)
    both = (columns.tapped >= 0) & (columns.response >= 0)
    factor = np.sum(along[:, both].conj() * left[:, both], axis=1) / np.sum(np.abs(along[:, both]) ** 2, axis=1)
    return np.asarray(factor[:, None] * along)


def residuals_with_untapped(residuals: Residuals | None, columns: ForceColumns) -> Residuals | None:
    """Return residuals of the taps with a column for each force; those of untapped forces by symmetry.

    What a force that was not tapped does along itself is left out: no measurement shows it, and it does not enter the
    chip of a cutter with an edge angle of 90 degrees.
    """
    if residuals is None:
        return None

    def whole(matrix: Real | Complex) -> Real | Complex:
        wide = np.zeros((*matrix.shape[:-1], len(columns.forces)), dtype=matrix.dtype)
        for q, (column, row) in enumerate(zip(columns.tapped, columns.response, strict=True)):
            if column >= 0:
                wide[..., q] = matrix[..., column] * columns.signs[q]
                continue
            for p, (other, other_row) in enumerate(zip(columns.tapped, columns.response, strict=True)):
                if other >= 0 and other_row >= 0:
                    signs = columns.response_signs[q] * columns.response_signs[p] * columns.signs[p]
                    wide[..., other_row, q] = matrix[..., row, other] * signs
        return wide

    residues = None if residuals.residues is None else np.asarray(whole(residuals.residues), complex)
    upper, lower = (np.asarray(whole(part), float) for part in (residuals.upper, residuals.lower))
    return Residuals(upper, lower, residuals.poles, residues)
