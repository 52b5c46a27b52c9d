"""Crossings of the unit circle of a discretised tooth period: by power series, or by eigenvalues where these fail."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real

from ..floquet.collocated_period import LoopGain, period_operator, piece_nodes
from ..floquet.depth_series import Windows, series_windows, transition_series
from ..milling_loop import DelaySystem
from .critical_lines import critical_lines, strongest_lines
from .crossings import Crossings, find_crossings, polished, row_edges, safe_depth, stages
from .winding_numbers import all_roots, refined

MOST_ROOTS = 256
"""At one speed and in one stage of depths."""


@dataclass(frozen=True)
class CircleCrossings:
    """Crossings with frequency and error of each, and how far down the search can be trusted.

    Parameters
    ----------
    crossings
        The crossings, by speed and then by depth.
    frequency : (n_crossings,), Hz
        Frequency of the strongest line of the tool's motion.
    error : (n_crossings,), m
        Change of the depth when more nodes are used.
    resolved : (n_speeds,), m
        Depth below which no cell of the search was left unresolved; infinite where all were resolved.
    """

    crossings: Crossings
    frequency: Real
    error: Real
    resolved: Real


def circle_crossings(system: DelaySystem, periods: Real, max_depth: float, *, lowest: bool = False) -> CircleCrossings:
    """Find all crossings up to ``max_depth`` (m) at several tooth periods.

    Depths are searched in stages that begin where the small-gain theorem ends and do not depend on ``max_depth``.

    Parameters
    ----------
    system
        Structure and process.
    periods : (n_speeds,), s
        Tooth periods. They share their nodes, so they should not differ by much.
    max_depth : m
        Largest axial depth that is searched.
    lowest
        Whether the search may end with the lowest crossing at each speed.

    Raises
    ------
    InputError
        The structure turns so often in a period that too many nodes would be needed.
    """
    if system.upper.any() or _many_modes(system, periods):
        return _by_eigenvalues(system, periods, max_depth)
    parts: list[CircleCrossings] = []
    resolved = np.full(len(periods), np.inf)
    live = np.arange(len(periods))
    for bottom, top in stages(safe_depth(system), max_depth):
        try:
            found, reach, lost = _by_series(system, periods[live], (bottom, top), lowest)
        except InputError:
            if not parts:
                raise
            resolved[live] = np.minimum(resolved[live], bottom)
            break
        parts.append(_renumbered(found, live))
        resolved[live] = np.minimum(resolved[live], reach)
        if lost.any():
            rest = _by_eigenvalues(system, periods[live[lost]], max_depth)
            parts.append(_chosen(rest, rest.crossings.depth > bottom, live[lost][rest.crossings.speed]))
        done = lost.copy()
        if lowest:
            done[np.unique(found.crossings.speed)] = True
        live = live[~done]
        if not len(live):
            break
    return _together(parts, resolved, max_depth)


def _together(parts: list[CircleCrossings], resolved: Real, max_depth: float) -> CircleCrossings:
    columns = [
        np.concatenate([getattr(part.crossings, name) for part in parts])
        for name in ("speed", "depth", "theta", "outward")
    ]
    frequency, error = (np.concatenate([getattr(part, name) for part in parts]) for name in ("frequency", "error"))
    order = np.lexsort([columns[1], columns[0]])
    order = order[columns[1][order] <= max_depth]
    return CircleCrossings(Crossings(*(column[order] for column in columns)), frequency[order], error[order], resolved)


def _chosen(part: CircleCrossings, chosen: NDArray[np.bool_], speed: Index) -> CircleCrossings:
    """Some crossings only, with other numbers of their speeds."""
    found = part.crossings
    kept = Crossings(speed[chosen], found.depth[chosen], found.theta[chosen], found.outward[chosen])
    return CircleCrossings(kept, part.frequency[chosen], part.error[chosen], part.resolved)


def _renumbered(part: CircleCrossings, speeds: Index) -> CircleCrossings:
    return _chosen(part, np.ones(len(part.error), dtype=bool), speeds[part.crossings.speed])


def _many_modes(system: DelaySystem, periods: Real) -> bool:
    """Whether eigenvalues are quicker: their size is that of the chip's nodes, that of the series twice the modes.

    Measured: at 24 rows of cells both take equally long where the former is about as large as the latter.
    """
    nodes = sum(count * len(piece.immersions) for piece, count in piece_nodes(system, periods))
    return nodes < 2 * len(system.poles)


def _by_series(
    system: DelaySystem, periods: Real, stage: tuple[float, float], lowest: bool
) -> tuple[CircleCrossings, Real, NDArray[np.bool_]]:
    """Crossings between two depths, how far they are resolved, and where rounding leaves too little of the series."""
    bottom, top = stage
    windows = series_windows(system, float(periods.max()), top)
    series = transition_series(system, periods, windows)
    edges = row_edges(bottom, top, windows.total_growth)
    angles = first_angles(system.poles, periods, count=max(24, int(np.ceil(0.8 * windows.total_growth))))
    table, reach = np.empty((len(periods), MOST_ROOTS, 3)), np.empty(len(periods))
    counts = all_roots(series.coefficients, series.needed, series.radius, edges, angles, lowest, table, reach)
    lost = (counts < 0) | (counts == MOST_ROOTS) | (not series.complete)
    counts = np.where(lost, 0, counts)
    rows = np.concatenate([part[:count] for part, count in zip(table, counts, strict=True)])
    speed = np.repeat(np.arange(len(periods)), counts)
    inside = (rows[:, 1] > bottom) & (rows[:, 1] <= top)
    rows, speed = rows[inside], speed[inside]
    order = np.lexsort([rows[:, 1], speed])
    theta, depth, growth = rows[order].T.copy()
    found, complete = _on_finer(system, periods, windows, (speed[order], theta, depth, growth))
    return found, reach, lost | (not complete)


def _on_finer(
    system: DelaySystem, periods: Real, windows: Windows, roots: tuple[Index, Real, Real, Real]
) -> tuple[CircleCrossings, bool]:
    """Roots (speed, theta, depth, growth) refined with more nodes, at the speeds that have any; whether that worked."""
    speed, theta, depth, growth = roots
    error = np.zeros(len(speed))
    present, place = np.unique(speed, return_inverse=True)
    if not len(present):
        nothing = Crossings(speed, depth, theta, growth > 0)
        return CircleCrossings(nothing, error, error, np.full(len(periods), np.inf)), True
    finer = transition_series(system, periods[present], windows, extra=4, chips=True)
    refined(finer.coefficients, finer.radius, place, theta, depth, growth, error)
    frequency = critical_lines(system, finer, Crossings(place, depth, theta, growth > 0))
    found = Crossings(speed, depth, theta, growth > 0)
    return CircleCrossings(found, frequency, error, np.full(len(periods), np.inf)), finer.complete


def _by_eigenvalues(system: DelaySystem, periods: Real, max_depth: float) -> CircleCrossings:
    operator = period_operator(system, periods)
    finer = period_operator(system, periods, extra=5)
    angles = first_angles(system.poles, periods)
    found = find_crossings(LoopGain(operator).eigenvalues, angles, max_depth)
    final, settled = polished(finer, found)
    depth = np.where(settled, final.depth, found.depth)
    theta = np.where(settled, final.theta, found.theta)
    error = np.where(settled, np.abs(final.depth - found.depth) + 1e-9 * final.depth, found.depth)
    crossings = Crossings(found.speed, depth, theta, found.outward)
    frequency = strongest_lines(system, finer, crossings)
    return CircleCrossings(crossings, frequency, error, np.full(len(periods), np.inf))


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
