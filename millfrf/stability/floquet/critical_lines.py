"""Crossings of the unit circle by the multipliers of a discretised tooth period, and their chatter frequencies."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real
from millfrf.core.compilation import compiled

from ..milling_loop import DelaySystem
from .characteristic import eliminate, transition
from .collocated_period import LoopGain, PeriodOperator, period_operator, piece_nodes
from .crossings import Crossings, find_crossings, polished, row_edges, safe_depth, stages
from .depth_series import TransitionSeries, Windows, series_windows, transition_series
from .winding_numbers import all_roots, refined


def critical_lines(system: DelaySystem, series: TransitionSeries, crossings: Crossings) -> Real:
    """Compute the same frequencies (Hz) as `strongest_lines`, from series instead of an operator.

    The series must include the chips at the nodes; the crossings belong to the speeds of the series.
    """
    result = np.empty(len(crossings.depth))
    _lines(
        series.coefficients,
        series.chips,
        series.radius,
        series.windows,
        series.times,
        series.weights,
        series.forces @ system.left.T,
        series.forces @ system.left.T.conj(),
        system.poles,
        np.ascontiguousarray(system.right),
        series.periods,
        crossings.speed,
        crossings.theta,
        crossings.depth,
        result,
    )
    return result


@compiled
def _null_vector(matrix: Complex) -> Complex:
    """Compute a vector of the null space of a nearly singular matrix by two inverse iterations."""
    size = len(matrix)
    vector = np.empty((size, 1), dtype=np.complex128)
    for i in range(size):
        vector[i, 0] = complex(1.0, 0.3 * i)
    for _ in range(2):
        copy = matrix.copy()
        eliminate(copy, vector)
        largest = 1e-300
        for i in range(size):
            largest = max(largest, abs(vector[i, 0]))
        for i in range(size):
            vector[i, 0] /= largest
    return vector[:, 0].copy()


@compiled
def _chips_of(
    series: Real, chips: Real, share: complex, windows: Index, state: Complex, weights: Real, result: Complex
) -> None:
    """Compute the chip at every node, times the node's weight, from the state at the beginning of the period."""
    size, powers = series.shape[2], series.shape[1]
    after = np.empty_like(state)
    for w in range(series.shape[0]):
        for node in range(len(windows)):
            if windows[node] != w:
                continue
            total = 0j
            for c in range(size):
                value = 0j
                for k in range(powers - 1, -1, -1):
                    value = value * share + chips[k, c, node]
                total += value * state[c]
            result[node] = total * weights[node]
        for i in range(size):
            total = 0j
            for j in range(size):
                value = 0j
                for k in range(powers - 1, -1, -1):
                    value = value * share + series[w, k, i, j]
                total += value * state[j]
            after[i] = total
        state, after = after, state


@compiled(
    "(float64[:,:,:,:,::1], float64[:,:,:,::1], float64, int64[::1], float64[::1], float64[::1], "
    "complex128[:,::1], complex128[:,::1], complex128[::1], complex128[:,::1], float64[::1], int64[::1], "
    "float64[::1], float64[::1], float64[::1])",
)
def _lines(
    series: Real,
    chips: Real,
    radius: float,
    windows: Index,
    times: Real,
    weights: Real,
    pushed: Complex,
    pushed_back: Complex,
    poles: Complex,
    right: Complex,
    periods: Real,
    speeds: Index,
    thetas: Real,
    depths: Real,
    result: Real,
) -> None:
    """Write the frequency (Hz) of the strongest line of every crossing to ``result``.

    The arguments are fields of `TransitionSeries`, `DelaySystem` and `Crossings`. ``pushed`` and ``pushed_back``
    (n_nodes, n_modes) are modal forces per chip, of the poles and of their conjugates.
    """
    modes, size, nodes = len(poles), 2 * len(poles), len(times)
    chip = np.empty(nodes, dtype=np.complex128)
    wave, step = np.empty(nodes, dtype=np.complex128), np.empty(nodes, dtype=np.complex128)
    for n in range(len(speeds)):
        s, theta, period = speeds[n], thetas[n], periods[speeds[n]]
        multiplier = complex(math.cos(theta), math.sin(theta))
        b = depths[n] * (1.0 - multiplier.conjugate())
        matrix, _ = transition(series[s], radius, b)
        for i in range(size):
            matrix[i, i] -= multiplier
        _chips_of(series[s], chips[s], b / radius, windows, _null_vector(matrix), weights, chip)
        top = math.ceil(1.5 * np.abs(poles).max() * period / (2 * math.pi)) + 1
        for i in range(nodes):
            step[i] = np.exp(-2j * math.pi * times[i])
            wave[i] = chip[i] * np.exp(-1j * (theta - 2 * math.pi * top) * times[i])
        strongest = -1.0
        for k in range(-top, top + 1):
            line = (theta + 2 * math.pi * k) / period
            x, y, z = 0j, 0j, 0j
            for r in range(modes):
                force, force_back = 0j, 0j
                for i in range(nodes):
                    force += wave[i] * pushed[i, r]
                    force_back += wave[i] * pushed_back[i, r]
                force /= 1j * line - poles[r]
                force_back /= 1j * line - poles[r].conjugate()
                x += force * right[r, 0] + force_back * right[r, 0].conjugate()
                y += force * right[r, 1] + force_back * right[r, 1].conjugate()
                z += force * right[r, 2] + force_back * right[r, 2].conjugate()
            motion = abs(x) ** 2 + abs(y) ** 2 + abs(z) ** 2
            if motion > strongest:
                strongest = motion
                result[n] = abs(line) / (2 * math.pi)
            for i in range(nodes):
                wave[i] *= step[i]


def strongest_lines(system: DelaySystem, operator: PeriodOperator, crossings: Crossings) -> Real:
    """Compute the frequency (Hz) of the strongest line of the tool's motion at each crossing.

    At a crossing the chip is ``h = (I - b G)^-1 E z`` with z in the null space of ``M(b) - mu``. The force of this chip
    has lines at ``(theta + 2 pi k) / tau``; each line moves the tool according to the receptance at its frequency.
    """
    if not len(crossings.depth):
        return np.zeros(0)
    multiplier = np.exp(1j * crossings.theta)
    b = (crossings.depth * (1 - 1 / multiplier))[:, None, None]
    size, n_nodes = operator.free.shape[-1], operator.within.shape[-1]
    chips = np.linalg.solve(
        np.eye(n_nodes) - b * operator.within[crossings.speed], operator.motion[crossings.speed] + 0j
    )
    transition = operator.free[crossings.speed] + b * operator.impulse[crossings.speed] @ chips
    state = np.linalg.svd(transition - multiplier[:, None, None] * np.eye(size))[2][:, -1].conj()
    nodes = (chips @ state[:, :, None])[:, :, 0]
    periods = operator.periods[crossings.speed]
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * periods.max() / (2 * np.pi))) + 1
    turns = crossings.theta[:, None] + 2 * np.pi * np.arange(-top, top + 1)
    wave = np.exp(-1j * turns[:, :, None] * operator.times)
    force = np.einsum("ckn,cn,nd->ckd", wave, nodes * operator.weights, operator.forces, optimize=True)
    line = turns / periods[:, None]
    motion = np.zeros_like(force)
    for pole, right, left in zip(system.poles, system.right, system.left, strict=True):
        motion += (force @ left / (1j * line - pole))[:, :, None] * right
        motion += (force @ left.conj() / (1j * line - pole.conj()))[:, :, None] * right.conj()
    strongest = np.argmax(np.linalg.norm(motion, axis=2), axis=1)
    return np.asarray(np.abs(line[np.arange(len(line)), strongest]) / (2 * np.pi))


def strongest_line(system: DelaySystem, speed: float, depth: float, multiplier: complex) -> float:
    """Compute the frequency (Hz) of the strongest line of the motion that belongs to a multiplier near the circle."""
    operator = period_operator(system, np.array([2 * np.pi / (system.process.teeth * speed)]))
    theta = np.array([abs(float(np.angle(multiplier)))])
    crossing = Crossings(np.zeros(1, dtype=np.int64), np.array([depth]), theta, np.ones(1, dtype=bool))
    return float(strongest_lines(system, operator, crossing)[0])


MOST_ROOTS = 256  # at one speed and in one stage of depths


@dataclass(frozen=True)
class CircleCrossings:
    """Crossings with frequency and error of each, and the depth up to which the search is complete."""

    crossings: Crossings  # by speed and then by depth
    frequency: Real  # (n_crossings,), Hz, of the strongest line of the tool's motion
    error: Real  # (n_crossings,), m: change of the depth when more nodes are used
    resolved: Real  # (n_speeds,), m: depth below which all cells of the search were resolved; infinite where all were


def circle_crossings(system: DelaySystem, periods: Real, max_depth: float, *, lowest: bool = False) -> CircleCrossings:
    """Find all crossings up to ``max_depth`` (m) at several tooth periods.

    Depths are searched in stages. The first begins at the depth up to which the small-gain theorem proves stability,
    and the stages do not depend on ``max_depth``. The tooth periods (n_speeds,), s, share their nodes and should be
    similar. With ``lowest`` the search may end with the lowest crossing at each speed.
    """
    if system.upper.any() or _many_modes(system, periods):
        return _by_eigenvalues(system, periods, max_depth)
    results: list[CircleCrossings] = []
    resolved = np.full(len(periods), np.inf)
    live = np.arange(len(periods))
    for bottom, top in stages(safe_depth(system), max_depth):
        try:
            result, reach, lost = _by_series(system, periods[live], (bottom, top), lowest)
        except InputError:
            if not results:
                raise
            resolved[live] = np.minimum(resolved[live], bottom)
            break
        results.append(_selected(result, np.ones(len(result.error), dtype=bool), live[result.crossings.speed]))
        resolved[live] = np.minimum(resolved[live], reach)
        if lost.any():
            other = _by_eigenvalues(system, periods[live[lost]], max_depth)
            results.append(_selected(other, other.crossings.depth > bottom, live[lost][other.crossings.speed]))
        done = lost.copy()
        if lowest:
            done[np.unique(result.crossings.speed)] = True
        live = live[~done]
        if not len(live):
            break
    return _joined(results, resolved, max_depth)


def _joined(results: list[CircleCrossings], resolved: Real, max_depth: float) -> CircleCrossings:
    columns = [
        np.concatenate([getattr(result.crossings, name) for result in results])
        for name in ("speed", "depth", "theta", "outward")
    ]
    frequency, error = (
        np.concatenate([getattr(result, name) for result in results]) for name in ("frequency", "error")
    )
    order = np.lexsort([columns[1], columns[0]])
    order = order[columns[1][order] <= max_depth]
    return CircleCrossings(Crossings(*(column[order] for column in columns)), frequency[order], error[order], resolved)


def _selected(result: CircleCrossings, rows: NDArray[np.bool_], speed: Index) -> CircleCrossings:
    """Select some crossings, and replace the indices of their speeds."""
    crossings = replace(result.crossings, speed=speed).select(rows)
    return CircleCrossings(crossings, result.frequency[rows], result.error[rows], result.resolved)


def _many_modes(system: DelaySystem, periods: Real) -> bool:
    """Check whether the structure has so many modes that eigenvalues are faster than series.

    The matrix of the eigenvalues has the number of nodes as its size, the series have twice the number of modes. With
    24 rows of cells, both take equally long if these sizes are about equal (measured).
    """
    nodes = sum(count * len(piece.immersions) for piece, count in piece_nodes(system, periods))
    return nodes < 2 * len(system.poles)


def _by_series(
    system: DelaySystem, periods: Real, stage: tuple[float, float], lowest: bool
) -> tuple[CircleCrossings, Real, NDArray[np.bool_]]:
    """Find crossings between two depths, the depths up to which they are complete, and speeds lost in rounding."""
    bottom, top = stage
    windows = series_windows(system, float(periods.max()), top)
    series = transition_series(system, periods, windows)
    edges = row_edges(bottom, top, windows.total_growth)
    angles = first_angles(system.poles, periods, count=max(24, int(np.ceil(0.8 * windows.total_growth))))
    table, reach = np.empty((len(periods), MOST_ROOTS, 3)), np.empty(len(periods))
    counts = all_roots(series.coefficients, series.needed, series.radius, edges, angles, lowest, table, reach)
    lost = (counts < 0) | (counts == MOST_ROOTS) | (not series.complete)
    counts = np.where(lost, 0, counts)
    rows = np.concatenate([roots[:count] for roots, count in zip(table, counts, strict=True)])
    speed = np.repeat(np.arange(len(periods)), counts)
    inside = (rows[:, 1] > bottom) & (rows[:, 1] <= top)
    rows, speed = rows[inside], speed[inside]
    order = np.lexsort([rows[:, 1], speed])
    theta, depth, growth = rows[order].T.copy()
    result, complete = _on_finer(system, periods, windows, (speed[order], theta, depth, growth))
    return result, reach, lost | (not complete)


def _on_finer(
    system: DelaySystem, periods: Real, windows: Windows, roots: tuple[Index, Real, Real, Real]
) -> tuple[CircleCrossings, bool]:
    """Refine roots (speed, theta, depth, growth) with more nodes; also return whether the series have converged."""
    speed, theta, depth, growth = roots
    error = np.zeros(len(speed))
    present, place = np.unique(speed, return_inverse=True)
    if not len(present):
        nothing = Crossings(speed, depth, theta, growth > 0)
        return CircleCrossings(nothing, error, error, np.full(len(periods), np.inf)), True
    finer = transition_series(system, periods[present], windows, extra=4, chips=True)
    refined(finer.coefficients, finer.radius, place, theta, depth, growth, error)
    frequency = critical_lines(system, finer, Crossings(place, depth, theta, growth > 0))
    crossings = Crossings(speed, depth, theta, growth > 0)
    return CircleCrossings(crossings, frequency, error, np.full(len(periods), np.inf)), finer.complete


def _by_eigenvalues(system: DelaySystem, periods: Real, max_depth: float) -> CircleCrossings:
    operator = period_operator(system, periods)
    finer = period_operator(system, periods, extra=5)
    angles = first_angles(system.poles, periods)
    coarse = find_crossings(LoopGain(operator).eigenvalues, angles, max_depth)
    final, settled = polished(finer, coarse)
    depth = np.where(settled, final.depth, coarse.depth)
    theta = np.where(settled, final.theta, coarse.theta)
    error = np.where(settled, np.abs(final.depth - coarse.depth) + 1e-9 * final.depth, coarse.depth)
    crossings = Crossings(coarse.speed, depth, theta, coarse.outward)
    frequency = strongest_lines(system, finer, crossings)
    return CircleCrossings(crossings, frequency, error, np.full(len(periods), np.inf))


def first_angles(poles: Complex, periods: Real, *, count: int = 24) -> Real:
    """Choose the angles theta in (0, pi] at which the search begins, (n_periods, n_angles), increasing, the last pi.

    They are denser at both ends and around every resonance.
    """
    even = (1 - np.cos(np.linspace(0, np.pi, count + 1)[1:])) * np.pi / 2
    turn = np.outer(periods, poles.imag)[:, :, None]
    width = np.minimum(-np.outer(periods, poles.real), 1.0)[:, :, None]
    near = turn + width * np.array([-6.0, -2.5, -0.9, 0.05, 0.9, 2.5, 6.0])
    folded = np.abs(np.mod(near + np.pi, 2 * np.pi) - np.pi).reshape(len(periods), -1)
    angles = [np.broadcast_to(even, (len(periods), count)), np.clip(folded, 1e-3, np.pi - 1e-3)]
    return np.asarray(np.sort(np.concatenate(angles, axis=1), axis=1))
