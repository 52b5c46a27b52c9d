"""Receptance of the base on each line, from taps on blanks: inverse receptance coupling by least squares."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex, InputError, Real

from ..settings import SETTINGS
from .assembly import FreeTool


@dataclass(frozen=True)
class TappedEntry:
    """One measured receptance of a blank in one direction.

    Parameters
    ----------
    blank
        Number of the blank.
    row, column
        Numbers of the points of response and force on this blank.
    values : (n_lines,), m/N
        Receptance.
    variance : (n_lines,), (m/N)^2
        Variance ``E|dH|^2``.
    """

    blank: int
    row: int
    column: int
    values: Complex
    variance: Real


@dataclass(frozen=True)
class BaseLines:
    """Receptance of a base over deflection and rotation on each line; reciprocal, so that three numbers are unknown.

    Parameters
    ----------
    numbers : (n_lines, 3)
        ``H`` (m/N), ``L = N`` (m per N m, or rad per N) and ``P`` (rad per N m).
    covariance : (n_lines, 3, 3)
        ``E[d conj(d)]`` of their errors from the noise of the taps, which is independent from line to line.
    residual : (n_entries, n_lines), complex
        What the taps leave over, in units of ``sqrt(variance / 2)``: real and imaginary parts have the variance 1.
    """

    numbers: Complex
    covariance: Complex
    residual: Complex

    @property
    def matrix(self) -> Complex:
        """Return the receptance, (n_lines, 2, 2)."""
        return _matrix(self.numbers)


def _matrix(numbers: Complex) -> Complex:
    return np.asarray(numbers[:, [0, 1, 1, 2]].reshape(-1, 2, 2))


def identify_lines(
    blanks: Sequence[FreeTool], entries: Sequence[TappedEntry], start: Complex | None = None
) -> BaseLines:
    """Find the receptance of the base with the least ``sum |H_measured - H|^2 / variance`` on each line.

    ``H_pq = R_pq - R_pe Z R_eq`` with ``Z = (R_ee + R_b)^-1`` (:meth:`FreeTool.on_base`) is solved by Levenberg and
    Marquardt, with ``dH_pq = f_p^T dR_b f_q`` and ``f = Z R_ep``. The start is linear: entries in two columns give
    ``f_p`` of their row, and ``R_b f_p = R_ep - R_ee f_p``.

    Parameters
    ----------
    blanks
        Free receptances of the blanks.
    entries
        Measured entries of one direction.
    start : (n_lines, 3)
        Numbers to start from on lines where they leave a smaller misfit than the linear solution; None: nowhere.

    Raises
    ------
    InputError
        Entries that do not determine the base.
    """
    weights = np.array([np.sqrt(2 / entry.variance) for entry in entries])
    measured = np.array([entry.values for entry in entries])
    numbers = _linear_start(blanks, entries)
    if start is not None:
        costs = [
            np.sum(np.abs(weights * (measured - _model(blanks, entries, each)[0])) ** 2, axis=0)
            for each in (numbers, start)
        ]
        numbers = np.where((costs[1] < costs[0])[:, None], start, numbers)
    model, slopes = _model(blanks, entries, numbers)
    residual = weights * (measured - model)
    cost, damping = np.sum(np.abs(residual) ** 2, axis=0), np.full(len(numbers), SETTINGS.first_base_damping)
    for _ in range(SETTINGS.base_steps):
        left, sizes, right, scale = _decomposed(slopes, weights)
        along = np.einsum("nek,en->nk", left.conj(), residual) * sizes / (sizes**2 + damping[:, None])
        trial = numbers + np.einsum("nkj,nk->nj", right.conj(), along) / scale
        model, trial_slopes = _model(blanks, entries, trial)
        after = weights * (measured - model)
        trial_cost = np.sum(np.abs(after) ** 2, axis=0)
        better = trial_cost < cost
        gain = np.where(better, cost - trial_cost, 0.0)
        numbers = np.where(better[:, None], trial, numbers)
        residual, slopes = np.where(better, after, residual), np.where(better[:, None], trial_slopes, slopes)
        cost, damping = np.where(better, trial_cost, cost), np.where(better, damping / 10, damping * 10)
        if gain.max() < SETTINGS.base_tolerance:
            break
    _, sizes, right, scale = _decomposed(slopes, weights)
    root = right / np.maximum(sizes, SETTINGS.least_singular)[:, :, None] / scale[:, None, :]
    return BaseLines(numbers, np.asarray(2 * np.einsum("nki,nkj->nij", root.conj(), root)), residual)


def _decomposed(slopes: Complex, weights: Real) -> tuple[Complex, Real, Complex, Real]:
    """Decompose weighted slopes with columns of length 1 on each line; return singular values and column lengths too.

    Near a resonance of a blank its points move alike, and the columns are almost parallel.
    """
    weighted = (slopes * weights[:, :, None]).swapaxes(0, 1)
    scale = np.maximum(np.linalg.norm(weighted, axis=1), 1e-300)
    left, sizes, right = np.linalg.svd(weighted / scale[:, None, :], full_matrices=False)
    return left, sizes, right, scale


def _model(blanks: Sequence[FreeTool], entries: Sequence[TappedEntry], numbers: Complex) -> tuple[Complex, Complex]:
    """Return the entries (n_entries, n_lines) that a base gives, and their derivatives (n_entries, n_lines, 3)."""
    base = _matrix(numbers)
    forces = [blank.forces(base) for blank in blanks]
    model, slopes = [], []
    for entry in entries:
        blank, force = blanks[entry.blank], forces[entry.blank]
        across = np.sum(blank.across[:, :, entry.row] * force[:, :, entry.column], axis=1)
        model.append(blank.points[:, entry.row, entry.column] - across)
        slopes.append(by_base(force[:, :, entry.row], force[:, :, entry.column]))
    return np.array(model), np.array(slopes)


def by_base(first: Complex, second: Complex) -> Complex:
    """Return derivatives by ``H, L, P`` (n_lines, 3) of a receptance between points with these forces (n_lines, 2)."""
    mixed = first[:, 0] * second[:, 1] + first[:, 1] * second[:, 0]
    return np.stack([first[:, 0] * second[:, 0], mixed, first[:, 1] * second[:, 1]], axis=1)


def _linear_start(blanks: Sequence[FreeTool], entries: Sequence[TappedEntry]) -> Complex:
    """Solve ``R_b f_p = R_ep - R_ee f_p`` for all points p of which entries with two other points are known."""
    equations, sides = [], []
    for number, blank in enumerate(blanks):
        for point in range(blank.across.shape[2]):
            own = {
                entry.column if entry.row == point else entry.row: entry.values
                for entry in entries
                if entry.blank == number and point in (entry.row, entry.column)
            }
            if len(own) < 2:
                continue
            others = blank.across[:, :, list(own)].swapaxes(1, 2)
            gap = blank.points[:, list(own), point] - np.array(list(own.values())).T
            force = (np.linalg.pinv(others) @ gap[:, :, None])[:, :, 0]
            zero = np.zeros_like(force[:, 0])
            equations += [np.stack([*force.T, zero], axis=1), np.stack([zero, *force.T], axis=1)]
            sides.append(blank.across[:, :, point] - (blank.end @ force[:, :, None])[:, :, 0])
    if len(equations) < 4:
        raise InputError(
            "the taps do not determine how the base turns: of one blank, hit and measure two points (direct and cross "
            "receptances), or of two blanks of different length the tip and its cross receptance to a second point"
        )
    matrix, side = np.stack(equations, axis=1), np.concatenate(sides, axis=1)
    scale = np.linalg.norm(matrix, axis=1)
    solved = np.linalg.pinv(matrix / scale[:, None, :]) @ side[:, :, None]
    return np.asarray(solved[:, :, 0] / scale)
