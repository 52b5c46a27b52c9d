"""Crossings of the unit circle of a discretised tooth period: by power series, or by eigenvalues where these fail."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .characteristic_roots import all_roots
from .chatter_frequency import strongest_lines
from .critical_lines import critical_lines
from .crossings import Crossings, find_crossings
from .delay_system import DelaySystem
from .loop_gain import LoopGain
from .period_operator import period_operator, piece_nodes
from .polish import polished
from .transition_series import series_windows, transition_series

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

MOST_ROOTS = 256
"""At one speed."""


def circle_crossings(
    system: DelaySystem, periods: Real, max_depth: float, *, lowest: bool = False
) -> tuple[Crossings, Real, Real]:
    """All crossings up to ``max_depth`` (m) at several tooth periods, with frequency and error.

    Parameters
    ----------
    system
        Structure and process.
    periods : (n_speeds,), s
        They share their nodes, so they should not differ by much.
    max_depth
        m.
    lowest
        The lowest crossing at each speed will do.

    Returns
    -------
    crossings
    frequency : (n_crossings,), Hz
        Of the strongest line of the tool's motion.
    error : (n_crossings,), m
        What more nodes change.
    """
    if system.upper.any() or _many_modes(system, periods):
        return _by_eigenvalues(system, periods, max_depth)
    (found, frequency, error), lost = _by_series(system, periods, max_depth, lowest)
    if not lost.any():
        return found, frequency, error
    rest, rest_frequency, rest_error = _by_eigenvalues(system, periods[lost], max_depth)
    rest = replace(rest, speed=np.flatnonzero(lost)[rest.speed])
    order = np.lexsort([np.concatenate([found.depth, rest.depth]), np.concatenate([found.speed, rest.speed])])
    columns = (
        np.concatenate([getattr(found, name), getattr(rest, name)])[order]
        for name in ("speed", "depth", "theta", "outward")
    )
    return (
        Crossings(*columns),
        np.concatenate([frequency, rest_frequency])[order],
        np.concatenate([error, rest_error])[order],
    )


def _many_modes(system: DelaySystem, periods: Real) -> bool:
    """Whether eigenvalues are quicker: their size is that of the chip's nodes, that of the series twice the modes.

    Measured: at 24 rows of cells both take equally long where the former is about as large as the latter.
    """
    nodes = sum(count * len(piece.immersions) for piece, count in piece_nodes(system, periods))
    return nodes < 2 * len(system.poles)


def _by_series(
    system: DelaySystem, periods: Real, max_depth: float, lowest: bool
) -> tuple[tuple[Crossings, Real, Real], NDArray[np.bool_]]:
    """Crossings, and at which speeds rounding leaves too little of the series."""
    windows = series_windows(system, float(periods.max()), max_depth)
    series = transition_series(system, periods, windows)
    finer = transition_series(system, periods, windows, extra=4, chips=True)
    rows = max(12 if lowest else 24, int(np.ceil(0.8 * windows.total_growth)))
    angles = first_angles(system.poles, periods, count=max(24, rows))
    table = np.empty((len(periods), MOST_ROOTS, 4))
    counts = all_roots(
        series.coefficients, finer.coefficients, series.needed, series.radius, max_depth, angles, rows, lowest, table
    )
    lost = (counts < 0) | (not (series.complete and finer.complete))
    counts = np.where(lost, 0, counts)
    together = np.concatenate([rows[:count] for rows, count in zip(table, counts, strict=True)])
    speed = np.repeat(np.arange(len(periods)), counts)
    order = np.lexsort([together[:, 1], speed])
    theta, depth, growth, error = together[order].T.copy()
    found = Crossings(speed[order], depth, theta, growth > 0)
    return (found, critical_lines(system, finer, found), error), lost


def _by_eigenvalues(system: DelaySystem, periods: Real, max_depth: float) -> tuple[Crossings, Real, Real]:
    operator = period_operator(system, periods)
    finer = period_operator(system, periods, extra=5)
    angles = first_angles(system.poles, periods)
    found = find_crossings(LoopGain(operator).eigenvalues, angles, max_depth)
    final, settled = polished(finer, found)
    depth = np.where(settled, final.depth, found.depth)
    theta = np.where(settled, final.theta, found.theta)
    error = np.where(settled, np.abs(final.depth - found.depth) + 1e-9 * final.depth, found.depth)
    crossings = Crossings(found.speed, depth, theta, found.outward)
    return crossings, strongest_lines(system, finer, crossings), error


def first_angles(poles: Complex, periods: Real, *, count: int = 24) -> Real:
    """Angles in (0, pi] to begin with at each period: clustered at both ends and about every resonance.

    Returns
    -------
    (n_periods, n_angles), increasing, the last pi
    """
    even = (1 - np.cos(np.linspace(0, np.pi, count + 1)[1:])) * np.pi / 2
    turn = np.outer(periods, poles.imag)[:, :, None]
    width = np.minimum(-np.outer(periods, poles.real), 1.0)[:, :, None]
    near = turn + width * np.array([-6.0, -2.5, -0.9, 0.05, 0.9, 2.5, 6.0])
    folded = np.abs(np.mod(near + np.pi, 2 * np.pi) - np.pi).reshape(len(periods), -1)
    together = [np.broadcast_to(even, (len(periods), count)), np.clip(folded, 1e-3, np.pi - 1e-3)]
    return np.asarray(np.sort(np.concatenate(together, axis=1), axis=1))
