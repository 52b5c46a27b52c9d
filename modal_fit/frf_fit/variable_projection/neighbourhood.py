"""The lines around a pole, freed of the modes far away: a candidate is tried there first, at little cost."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .elimination import Complex, Elimination, Modes, Real, shaped
from .whitened_lines import MeasuredLines

_WIDTH = 6.0  # half widths of the pole's half-power band
_FEWEST = 24  # lines
_LINES_PER_TERM = 6


def around(frequency: float, damping_ratio: float, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Lines around a pole: six half-power bands to each side, at least as many as the unknowns need."""
    axis = lines.frequencies
    half = max(_WIDTH * damping_ratio * frequency, 0.5 * _FEWEST * lines.spacing)
    wanted = min(len(axis), max(_FEWEST, _LINES_PER_TERM * len(lines.basis)))
    chosen = np.abs(axis - frequency) <= half
    while chosen.sum() < wanted:
        half *= 1.3
        chosen = np.abs(axis - frequency) <= half
    return np.asarray(chosen)


def half_power_lines(pole: complex, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Lines inside a pole's half-power band, at least five where the grid has them."""
    frequency, damping_ratio = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    half = max(damping_ratio * frequency, 2.5 * lines.spacing)
    return np.asarray(np.abs(lines.frequencies - frequency) <= half)


def without_modes(lines: MeasuredLines, modes: Modes, right: Complex) -> MeasuredLines:
    """The lines with some modes' contribution taken away; ``right`` (n_modes, n_responses) is whitened."""
    if not len(modes.poles):
        return lines
    direct, mirror = shaped(modes, lines)
    contribution = np.einsum("kjr,rp->kjp", direct, right, optimize=True)
    contribution += np.einsum("kjr,rp->kjp", mirror, right.conj(), optimize=True)
    return replace(lines, values=lines.values - contribution)


def mode_power(modes: Modes, right: Complex, lines: MeasuredLines) -> Real:
    """Power of each mode's own contribution on each line, shape (n_lines, n_modes).

    Powers of modes do not cancel as the modes themselves do at an antiresonance, so that their sum is the measure of
    what an error of the modes can leave on a line.
    """
    direct, _ = shaped(modes, lines)
    return np.asarray(np.sum(np.abs(direct) ** 2, axis=1) * np.sum(np.abs(right) ** 2, axis=1))


def outside_power(found: Elimination, lines: MeasuredLines) -> Real:
    """Power of the out-of-band terms on each line, shape (n_lines,)."""
    n_terms, n_excitations = len(lines.basis), lines.drive.shape[2]
    coefficients = found.outside.reshape(n_terms, n_excitations, -1)
    terms = np.einsum("nk,nqp->kqp", lines.basis * lines.factor, coefficients, optimize=True)
    driven = np.einsum("kjq,kqp->kjp", lines.drive, terms, optimize=True)
    return np.asarray(np.sum(np.abs(driven) ** 2, axis=(1, 2)))


def participation(pole: complex, lines: MeasuredLines, found: Elimination) -> Complex:
    """Give the left vector of a new pole: the leading one of the residue matrix that the residual asks for.

    Parameters
    ----------
    pole : rad/s
        The new pole, in the upper half plane.
    lines
        Lines on which the residue matrix is fitted.
    found
        Fit without the pole; the part of the lines that it can explain is projected out.

    Returns
    -------
    (1, n_excitations)
    """
    n_excitations = lines.drive.shape[2]
    direct = (lines.factor / (lines.s - pole))[:, None, None] * lines.drive
    mirror = (lines.factor / (lines.s - np.conj(pole)))[:, None, None] * lines.drive
    columns = np.concatenate([direct + mirror, 1j * (direct - mirror)], axis=2).reshape(-1, 2 * n_excitations)
    real = np.concatenate([columns.real, columns.imag])
    real -= found.orthogonal @ (found.orthogonal.T @ real)
    solved = np.linalg.lstsq(real, found.error, rcond=1e-10)[0]
    residue = solved[:n_excitations] + 1j * solved[n_excitations:]
    # residue[q, p] = left[q] right[p]
    return np.asarray(np.linalg.svd(residue)[0][:, 0][None, :])


def participations(poles: Complex, lines: MeasuredLines) -> Complex:
    """Left vectors of many poles at once, from full residue matrices, shape (n_modes, n_excitations).

    Each entry of the FRF matrix has the same regressors, so that one factorisation serves all.
    """
    n_modes, (_, n_columns, n_excitations) = len(poles), lines.drive.shape
    weights = np.sqrt(np.mean(lines.weights**2, axis=1))
    if n_columns == n_excitations:
        matrix = np.linalg.solve(lines.drive, lines.values)
    else:
        matrix = np.linalg.pinv(lines.drive) @ lines.values
    direct = lines.factor[:, None] / (lines.s[:, None] - poles)
    mirror = lines.factor[:, None] / (lines.s[:, None] - poles.conj())
    outside = (lines.basis * lines.factor).T
    columns = np.concatenate([direct + mirror, 1j * (direct - mirror), outside], axis=1) * weights[:, None]
    target = (matrix * weights[:, None, None]).reshape(len(weights), -1)
    real = np.concatenate([columns.real, columns.imag])
    scale = np.linalg.norm(real, axis=0)
    solved = np.linalg.lstsq(real / scale, np.concatenate([target.real, target.imag]), rcond=1e-12)[0] / scale[:, None]
    residues = (solved[:n_modes] + 1j * solved[n_modes : 2 * n_modes]).reshape(n_modes, n_excitations, -1)
    return np.asarray(np.linalg.svd(residues, full_matrices=False)[0][:, :, 0])
