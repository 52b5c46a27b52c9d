"""Crossings of the unit circle of a discretised tooth period: by power series, or by eigenvalues where these cancel."""

import numpy as np
from numpy.typing import NDArray

from .characteristic import Characteristic, characteristic
from .characteristic_roots import newton, roots
from .crossings import SLOPE_STEP, Crossings, find_crossings, nearest
from .loop_gain import LoopGain
from .period_operator import PeriodOperator

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def circle_crossings(operator: PeriodOperator, poles: Complex, max_depth: float) -> Crossings:
    """All crossings up to ``max_depth`` (m) at the operator's speeds.

    Parameters
    ----------
    operator
        One tooth period at several speeds.
    poles : (n_modes,), rad/s
        Of the structure: where along the circle to look closely.
    max_depth
        m.
    """
    angles = first_angles(poles, operator.periods)
    series = characteristic(operator, max_depth)
    if series.usable:
        return _by_series(series, angles, max_depth)
    return find_crossings(LoopGain(operator).eigenvalues, angles, max_depth)


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


def _by_series(series: Characteristic, angles: Real, max_depth: float) -> Crossings:
    found = np.empty((256, 3))
    needed = series.needed_powers()
    speeds, rows = [], []
    for k, coefficients in enumerate(series.coefficients):
        count = roots(coefficients, needed[k], series.radius, max_depth, angles[k], 24, found)
        here = found[:count]
        rows.append(here[np.argsort(here[:, 1])])
        speeds.append(np.full(count, k))
    together = np.concatenate(rows)
    return Crossings(np.concatenate(speeds), together[:, 1].copy(), together[:, 0].copy(), together[:, 2] > 0)


def depth_errors(finer: PeriodOperator, found: Crossings, max_depth: float) -> Real:
    """How far an operator with more nodes moves each depth, and the root's own tolerance, m.

    Parameters
    ----------
    finer
        The same periods with more nodes.
    found
        Crossings with the nodes that are to be judged.
    max_depth
        m.
    """
    if not len(found.depth):
        return np.zeros(0)
    series = characteristic(finer, max_depth)
    moved = _moved_series(series, found) if series.usable else np.full(len(found.depth), np.nan)
    lost = np.isnan(moved)
    if lost.any():
        moved[lost] = _moved_eigenvalues(LoopGain(finer), found)[lost]
    return np.asarray(np.abs(moved) + 1e-9 * found.depth)


def _moved_series(series: Characteristic, found: Crossings) -> Real:
    moved = np.full(len(found.depth), np.nan)
    for k, (speed, theta, depth) in enumerate(zip(found.speed, found.theta, found.depth, strict=True)):
        good, _, there, _ = newton(series.coefficients[speed], series.radius, theta, depth, 0.1, 0.05 * depth)
        if good:
            moved[k] = there - depth
    return moved


def _moved_eigenvalues(gain: LoopGain, found: Crossings) -> Real:
    """First-order: the root moves along the circle until the imaginary part vanishes again."""
    before = (1 / found.depth).astype(np.complex128)
    there = nearest(gain.eigenvalues(found.speed, found.theta), before)
    slope = (there - nearest(gain.eigenvalues(found.speed, found.theta - SLOPE_STEP), there)) / SLOPE_STEP
    steep = np.where(found.theta == np.pi, 0.0, slope.real / slope.imag)
    change = there - before
    return np.asarray(found.depth**2 * (np.abs(change.real) + np.abs(change.imag * steep)))
