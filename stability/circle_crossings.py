"""Crossings of the unit circle of a discretised tooth period: by power series, or by eigenvalues where these cancel."""

import numpy as np
from numpy.typing import NDArray

from .characteristic import Characteristic, characteristic
from .characteristic_roots import all_roots
from .crossings import Crossings, find_crossings
from .loop_gain import LoopGain
from .period_operator import PeriodOperator
from .polish import polished

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def circle_crossings(
    operator: PeriodOperator, finer: PeriodOperator, poles: Complex, max_depth: float
) -> tuple[Crossings, Real]:
    """All crossings up to ``max_depth`` (m) at the operator's speeds, and the error of their depths.

    Parameters
    ----------
    operator
        One tooth period at several speeds.
    finer
        The same with more nodes; the crossings are refined on it, and what that changes is their error.
    poles : (n_modes,), rad/s
        Of the structure: where along the circle to look closely.
    max_depth
        m.

    Returns
    -------
    crossings
    error : (n_crossings,), m
    """
    angles = first_angles(poles, operator.periods)
    series = characteristic(operator, max_depth)
    if series.usable:
        found, settled = polished(operator, _by_series(series, angles, max_depth))
        final, settled_again = polished(finer, found)
        if settled.all() and settled_again.all() and _complete(operator, final, max_depth):
            return final, np.abs(final.depth - found.depth) + 1e-9 * final.depth
    found = find_crossings(LoopGain(operator).eigenvalues, angles, max_depth)
    final, settled = polished(finer, found)
    depth = np.where(settled, final.depth, found.depth)
    theta = np.where(settled, final.theta, found.theta)
    error = np.where(settled, np.abs(final.depth - found.depth) + 1e-9 * final.depth, found.depth)
    return Crossings(found.speed, depth, theta, found.outward), error


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


def _complete(operator: PeriodOperator, found: Crossings, max_depth: float) -> bool:
    """Whether the crossings account for the unstable multipliers that two depths really have at every speed.

    Cells too coarse for a function that turns fast miss crossings, and cannot know it themselves.
    """
    change = np.where(found.outward, 1, -1) * np.where(found.theta == np.pi, 1, 2)
    n_speeds, n_nodes, size = operator.motion.shape
    for depth in (0.4 * max_depth, max_depth):
        near = np.abs(found.depth - depth) < 1e-6 * depth
        expected = np.zeros(n_speeds, dtype=np.int64)
        np.add.at(expected, found.speed, np.where(found.depth < depth, change, 0))
        within = depth * operator.within
        drive = np.concatenate([operator.motion, -within], axis=2)
        chip = np.linalg.solve(np.eye(n_nodes) - within, drive)
        regained = chip.copy()
        regained[:, :, size:] -= np.eye(n_nodes)
        state = depth * operator.impulse @ regained
        state[:, :, :size] += operator.free
        unstable = np.abs(np.linalg.eigvals(np.concatenate([state, chip], axis=1))) > 1
        wrong = unstable.sum(axis=1) != expected
        wrong[found.speed[near]] = False
        if wrong.any():
            return False
    return True


def _by_series(series: Characteristic, angles: Real, max_depth: float) -> Crossings:
    found = np.empty((len(angles), 128, 3))
    counts = all_roots(series.coefficients, series.needed_powers(), series.radius, max_depth, angles, 24, found)
    together = np.concatenate(
        [rows[:count][np.argsort(rows[:count, 1])] for rows, count in zip(found, counts, strict=True)]
    )
    speed = np.repeat(np.arange(len(angles)), counts)
    return Crossings(speed, together[:, 1].copy(), together[:, 0].copy(), together[:, 2] > 0)
