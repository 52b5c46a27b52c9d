"""Receptance of a modal model at spectral lines, and products of small matrices; compiled."""

from dataclasses import replace

import numpy as np

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled
from modal_fit import ModalModel

from .modal_loops import add_outside, modal_displacement


def receptance_at(model: ModalModel, frequencies: Real) -> Complex:
    """Receptance (n, n_responses, n_excitations) at lines from 0 Hz on.

    A residual inertia stands for modes below the band and says nothing below it: under a third of the lowest mode it
    is left out, or the mean cutting force would carry the tool away.
    """
    if model.residuals is None or not model.residuals.lower.any():
        return model.receptance(frequencies)
    plain = replace(model, residuals=replace(model.residuals, lower=np.zeros_like(model.residuals.lower)))
    values = plain.receptance(frequencies)
    inside = frequencies >= model.natural_frequencies.min() / 3
    values[inside] -= model.residuals.lower / (2 * np.pi * frequencies[inside, None, None]) ** 2
    return values


def displacement_at(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """``H F`` (n, n_responses) at lines from 0 Hz on, with H as in :func:`receptance_at` but never written out.

    Parameters
    ----------
    frequencies : (n,), Hz
        Frequencies of the lines, from 0 Hz on.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.empty((len(s), model.right.shape[1]), dtype=complex)
    modal_displacement(s, model.poles, model.right, model.left, np.ascontiguousarray(force), out)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def outside_displacement(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """The part of :func:`displacement_at` that modes outside the band make, (n, n_responses), m.

    Parameters
    ----------
    model
        Modal model, with the residual terms that stand for those modes.
    frequencies, force
        As for :func:`displacement_at`.
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.zeros((len(s), model.right.shape[1]), dtype=complex)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def _add_outside(model: ModalModel, s: Complex, force: Complex, out: Complex) -> None:
    """Add the residual terms' part; under a third of the lowest mode a residual inertia is left out."""
    if model.residuals is None:
        return
    own = model.residuals
    poles = np.zeros(0, dtype=complex) if own.poles is None else np.asarray(own.poles, dtype=complex)
    residues = np.zeros((0, *own.upper.shape)) if own.residues is None else own.residues
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    plain = (np.ascontiguousarray(own.upper, dtype=float), np.ascontiguousarray(own.lower, dtype=float))
    terms = (np.ascontiguousarray(poles), np.ascontiguousarray(residues, dtype=complex))
    add_outside(s, terms, plain, lowest, np.ascontiguousarray(force, dtype=complex), out)


def line_products(one: Complex, other: Complex) -> Complex:
    """``A_k B_k`` of every line: one BLAS call a line would cost more than the product.

    Parameters
    ----------
    one : (n_lines, n, m)
        Matrix A of each line, in any unit.
    other : (n_lines, m) or (n_lines, m, n_columns)
        Vectors or matrices B.

    Examples
    --------
    >>> line_products(np.full((1, 2, 2), 1 + 0j), np.array([[1, 2j]])).tolist()
    [[(1+2j), (1+2j)]]
    """
    columns = np.ascontiguousarray(other, dtype=complex).reshape(*other.shape[:2], -1)
    out = np.empty((*one.shape[:2], columns.shape[2]), dtype=complex)
    _multiply(np.ascontiguousarray(one, dtype=complex), columns, out)
    return out.reshape(*one.shape[:2], *other.shape[2:])


def closed_loop(receptance: Complex, feedback: Complex) -> Complex:
    """``(I + H K)^-1 H`` of every line, with H (n_lines, n, m) and K (n_lines, m, n); further columns of H go along.

    Raises
    ------
    numpy.linalg.LinAlgError
        ``I + H K`` is singular at a line.
    """
    loop = line_products(receptance[:, :, : feedback.shape[1]], feedback)
    diagonal = np.arange(loop.shape[1])
    loop[:, diagonal, diagonal] += 1
    result = np.array(receptance, dtype=complex, order="C")
    if not _solve(loop, result):
        raise np.linalg.LinAlgError("the feedback around the structure is singular at a line")
    return result


@compiled(
    "(complex128[:,:,::1], complex128[:,:,::1], complex128[:,:,::1])",
)
def _multiply(one: Complex, other: Complex, out: Complex) -> None:
    """Write the products."""
    for k in range(len(one)):
        for i in range(one.shape[1]):
            for c in range(other.shape[2]):
                value = one[k, i, 0] * other[k, 0, c]
                for j in range(1, one.shape[2]):
                    value += one[k, i, j] * other[k, j, c]
                out[k, i, c] = value


@compiled(
    "(complex128[:,:,::1], complex128[:,:,::1])",
)
def _solve(matrix: Complex, right: Complex) -> bool:
    """Overwrite ``right`` by ``A^-1 B`` (Gauss, with the largest pivot of each column); False where A is singular."""
    n = matrix.shape[1]
    for k in range(len(matrix)):
        a, b = matrix[k], right[k]
        for j in range(n):
            if not _bring_up(a, b, j):
                return False
            inverse = 1.0 / a[j, j]
            for i in range(j + 1, n):
                factor = a[i, j] * inverse
                for c in range(j + 1, n):
                    a[i, c] -= factor * a[j, c]
                for c in range(b.shape[1]):
                    b[i, c] -= factor * b[j, c]
        _substitute_back(a, b)
    return True


@compiled
def _bring_up(matrix: Complex, right: Complex, column: int) -> bool:
    """Exchange rows so that the largest entry of a column below the diagonal is the pivot; False if it is zero."""
    chosen = column
    for i in range(column + 1, len(matrix)):
        if abs(matrix[i, column]) > abs(matrix[chosen, column]):
            chosen = i
    if chosen != column:
        for c in range(len(matrix)):
            matrix[column, c], matrix[chosen, c] = matrix[chosen, c], matrix[column, c]
        for c in range(right.shape[1]):
            right[column, c], right[chosen, c] = right[chosen, c], right[column, c]
    pivot: bool = abs(matrix[column, column]) != 0.0
    return pivot


@compiled
def _substitute_back(upper: Complex, right: Complex) -> None:
    """Overwrite ``right`` by ``U^-1 B``."""
    n = len(upper)
    for i in range(n - 1, -1, -1):
        inverse = 1.0 / upper[i, i]
        for c in range(right.shape[1]):
            value = right[i, c]
            for j in range(i + 1, n):
                value -= upper[i, j] * right[j, c]
            right[i, c] = value * inverse
