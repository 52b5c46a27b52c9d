"""All roots (theta, depth) of the characteristic function, by winding numbers on cells; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled

from .cell_search import clear, put, search
from .characteristic import newton, values, workspace
from .period_doublings import period_doublings

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

AT_PI = 4
"""Steps in a row of cells at which the real F(pi, a) is looked at."""


@compiled
def roots(
    series: Real,
    needed: Index,
    radius: float,
    edges: Real,
    angles: Real,
    lowest: bool,
    found: Real,
) -> tuple[int, float]:
    """Write roots between the first and the last edge into rows (theta, depth, growth) of ``found``.

    On each cell the turns of F along the four edges are added: a sum of one whole turn is one root inside. Cells with
    edges that turn by more than 1.2 rad are split into four until they are clear. At pi, where F is real, its changes
    of sign are period doublings, and so are its roots in cells there: two close ones do not change the sign.

    Parameters
    ----------
    series, needed, radius
        Power series of the transition at one speed, as for :func:`values`.
    edges : (n_rows + 1,), m
        Depths that bound the rows of cells, increasing.
    angles : (n_angles,), rad
        Edges of cells in theta, increasing, the last pi.
    lowest
        Stop above the row of cells with the lowest root.
    found : (most, 3)
        Receives the roots.

    Returns
    -------
    filled
        How many there are; -1 where F is lost in rounding.
    resolved
        Depth below which no cell was left unresolved, m; infinite where all were resolved.
    """
    count = len(angles)
    # the row's own depths, and one beyond, so that a dip about its end is seen
    lanes = count + AT_PI + 1
    filled, resolved = 0, np.inf
    stack, corners = np.empty((256, 5)), np.empty((256, 4), dtype=np.complex128)
    work = workspace(series.shape[2], lanes)
    small = workspace(series.shape[2], 5)
    theta, depth = np.full(lanes, math.pi), np.full(lanes, edges[0])
    below, above = np.empty(lanes, dtype=np.complex128), np.empty(lanes, dtype=np.complex128)
    heights, depths = np.empty(AT_PI + 2), np.empty(AT_PI + 2)
    theta[:count] = angles
    # period doublings shall lie inside cells, not on their edges
    theta[count - 1] += 0.37 * (theta[count - 1] - theta[count - 2])
    values(series, needed, radius, theta, depth, lanes, work, below)
    depths[0], heights[0] = edges[0], below[count].real
    for j in range(len(edges) - 1):
        bottom, top = edges[j], edges[j + 1]
        depth[:count] = top
        for k in range(AT_PI + 1):
            depth[count + k] = min(bottom + (top - bottom) * (k + 1) / AT_PI, radius / 2)
            depths[k + 1] = depth[count + k]
        values(series, needed, radius, theta, depth, lanes, work, above)
        if (above == 0).any():
            return -1, resolved
        heights[1:] = above[count:].real
        filled = period_doublings(series, needed, radius, depths, heights, found, filled)
        depths[0], heights[0] = top, heights[AT_PI]
        for i in range(count - 1):
            f00, f10, f11, f01 = below[i], below[i + 1], above[i + 1], above[i]
            if clear(f00, f10) and clear(f10, f11) and clear(f11, f01) and clear(f01, f00):
                continue
            put(stack, corners, 0, theta[i], theta[i + 1], bottom, top, 0.0, f00, f10, f11, f01)
            filled, here = search(series, needed, radius, stack, corners, small, found, filled)
            resolved = min(resolved, here)
        if lowest and filled and found[:filled, 1].min() <= top:
            break
        below, above = above, below
    return filled, resolved


@compiled
def all_roots(
    series: Real,
    needed: Index,
    radius: float,
    edges: Real,
    angles: Real,
    lowest: bool,
    found: Real,
    resolved: Real,
) -> Index:
    """Roots at every speed: (theta, depth, growth), lowest first.

    Parameters
    ----------
    series, needed, angles
        One row a speed, otherwise as for :func:`roots`.
    radius, edges
        As for :func:`roots`.
    found : (n_speeds, most, 3)
        Receives the roots; all of them, or the lowest alone.
    resolved : (n_speeds,), m
        Receives the depths below which no cell was left unresolved.

    Returns
    -------
    (n_speeds,)
        How many; -1 where the characteristic function is lost in rounding.
    """
    counts = np.zeros(len(series), dtype=np.int64)
    for s in range(len(series)):
        first = np.empty((found.shape[1], 3))
        count, resolved[s] = roots(series[s], needed[s], radius, edges, angles[s], lowest, first)
        if count < 0:
            counts[s] = -1
            continue
        order = np.argsort(first[:count, 1])
        if lowest:
            order = order[:1]
        for row, k in enumerate(order):
            found[s, row] = first[k]
        counts[s] = len(order)
    return counts


@compiled
def refined(finer: Real, radius: float, speed: Index, theta: Real, depth: Real, growth: Real, error: Real) -> None:
    """Move roots to where they lie on series with more nodes; what that changes is the error.

    Parameters
    ----------
    finer : (n_speeds, n_windows, n_powers, n, n)
        Power series with more nodes, as in ``TransitionSeries``.
    radius : m
        Largest ``|b|`` that the series are made for.
    speed, theta, depth, growth : (n_roots,)
        Index of the speed, argument of the multiplier (rad), depth (m) and growth of each root; the last three are
        overwritten.
    error : (n_roots,), m
        Receives the error; the depth itself where the root is lost.
    """
    for k in range(len(speed)):
        good, moved, final, there = newton(finer[speed[k]], radius, theta[k], depth[k], 0.1, 0.1 * depth[k])
        error[k] = depth[k]
        if good:
            error[k] = abs(final - depth[k]) + 1e-9 * final
            theta[k], depth[k], growth[k] = moved, final, there
