"""Chatter frequency: the strongest spectral line of the Floquet mode at a crossing."""

import math

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import compiled

from ..floquet.collocated_period import PeriodOperator, period_operator
from ..floquet.depth_series import TransitionSeries
from ..milling_loop import DelaySystem
from .characteristic import eliminate, transition
from .crossings import Crossings


def critical_lines(system: DelaySystem, series: TransitionSeries, found: Crossings) -> Real:
    """Give the frequency (Hz) of the strongest line of the tool's motion at each crossing, as ``strongest_lines`` does.

    Parameters
    ----------
    system
        Structure and process.
    series
        Power series that keep the chips at the nodes.
    found
        Crossings at the series' speeds.
    """
    result = np.empty(len(found.depth))
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
        found.speed,
        found.theta,
        found.depth,
        result,
    )
    return result


@compiled
def _null_vector(matrix: Complex) -> Complex:
    """Direction that the matrix nearly annihilates, by two inverse iterations."""
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
    """Chip times weight at every node for a state at the beginning of the period."""
    size, powers = series.shape[2], series.shape[1]
    after = np.empty_like(state)
    for w in range(series.shape[0]):
        for node in range(len(windows)):
            if windows[node] != w:
                continue
            total = 0j
            for c in range(size):
                one = 0j
                for k in range(powers - 1, -1, -1):
                    one = one * share + chips[k, c, node]
                total += one * state[c]
            result[node] = total * weights[node]
        for i in range(size):
            total = 0j
            for j in range(size):
                one = 0j
                for k in range(powers - 1, -1, -1):
                    one = one * share + series[w, k, i, j]
                total += one * state[j]
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
    """Write the strongest line of every crossing.

    Parameters
    ----------
    series, chips, radius, windows, times, weights, periods
        Fields of ``TransitionSeries``, of the same names.
    pushed, pushed_back : (n_nodes, n_modes)
        Modal forces per chip, of the poles and of their conjugates.
    poles, right
        Poles and right vectors of ``DelaySystem``.
    speeds, thetas, depths
        Fields ``speed``, ``theta`` and ``depth`` of ``Crossings``.
    result : (n_crossings,), Hz
        Receives the frequency of the strongest line.
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


def strongest_lines(system: DelaySystem, operator: PeriodOperator, found: Crossings) -> Real:
    """Frequency (Hz) of the strongest line of the tool's motion at each crossing.

    The chip of the critical mode is ``h = (I - b G)^-1 E z`` with z in the null space of ``M(b) - mu``; its force has
    lines at ``(theta + 2 pi k) / tau``, and each moves the tool by the structure's receptance there.

    Parameters
    ----------
    system, operator
        Structure and its discretised tooth period.
    found
        Crossings at the operator's speeds.
    """
    if not len(found.depth):
        return np.zeros(0)
    multiplier = np.exp(1j * found.theta)
    b = (found.depth * (1 - 1 / multiplier))[:, None, None]
    size, n_nodes = operator.free.shape[-1], operator.within.shape[-1]
    chips = np.linalg.solve(np.eye(n_nodes) - b * operator.within[found.speed], operator.motion[found.speed] + 0j)
    transition = operator.free[found.speed] + b * operator.impulse[found.speed] @ chips
    state = np.linalg.svd(transition - multiplier[:, None, None] * np.eye(size))[2][:, -1].conj()
    nodes = (chips @ state[:, :, None])[:, :, 0]
    periods = operator.periods[found.speed]
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * periods.max() / (2 * np.pi))) + 1
    turns = found.theta[:, None] + 2 * np.pi * np.arange(-top, top + 1)
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
    """Give the frequency (Hz) of the strongest line of one motion whose multiplier lies on the circle, or near it.

    Parameters
    ----------
    system
        Structure and process.
    speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    multiplier
        Floquet multiplier of the motion.
    """
    operator = period_operator(system, np.array([2 * np.pi / (system.process.teeth * speed)]))
    theta = np.array([abs(float(np.angle(multiplier)))])
    here = Crossings(np.zeros(1, dtype=np.int64), np.array([depth]), theta, np.ones(1, dtype=bool))
    return float(strongest_lines(system, operator, here)[0])
