"""Semi-discretisation: the delayed motion is a polynomial over each small step, everything else is exact."""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from cutting import MillingProcess, directional_matrix
from foundation import InputError
from modal_fit import ModalModel

from .delay_system import DelaySystem, delay_system
from .stability_lobes import StabilityLobes
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_DEPTHS = 40
_AVERAGE = 8  # Gauss points for the mean of alpha over a part of a step


def semi_discretisation(
    structure: ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    steps: int = 80,
    order: int = 1,
    tolerance: float = 1e-4,
) -> StabilityLobes:
    """Lowest unstable depth at each speed: a scan over depth, then bisection of the spectral radius.

    Over each of ``steps`` intervals of the tooth period the directional matrix is its mean and the delayed tool
    position a polynomial of degree ``order`` through known points (0: mean of both ends, 1: linear); the state is
    integrated exactly (Insperger & Stepan, Semi-Discretization for Time-Delay Systems, 2011, chapter 3). The error
    falls with the square of the step; :func:`collocation` converges faster and is the solver to use, this one
    is its independent check.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter with teeth of equal pitch.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        m.
    steps
        Intervals a tooth period.
    order
        0 or 1.
    tolerance
        Relative, of the depth.

    Raises
    ------
    InputError
        Speeds, depth, steps or order that cannot be, or a structure that cannot be used.
    """
    speeds = checked_speeds(spindle_speeds, max_depth)
    if steps < 4 or order not in (0, 1):
        raise InputError(f"{steps} steps of order {order}: give 4 steps or more, and order 0 or 1")
    system = delay_system(structure, process)
    warnings = system.warnings
    if system.upper.any():
        warnings = (*warnings, "the residual flexibility is left out of the semi-discretisation")
    limits, chatter, kinds = np.full(len(speeds), np.inf), np.full(len(speeds), np.nan), ["none"] * len(speeds)
    for k, speed in enumerate(speeds):
        means = mean_directional_matrices(process, steps)
        period = 2 * math.pi / (process.teeth * float(speed))

        def multipliers(depth: float, period: float = period, means: Real = means) -> Complex:
            return one_period_multipliers(system, process.ktc * depth * means, period, order)

        low, high = 0.0, math.nan
        for depth in max_depth * np.linspace(0, 1, _DEPTHS + 1)[1:] ** 2:
            if np.abs(multipliers(float(depth))).max() > 1:
                high = float(depth)
                break
            low = float(depth)
        if math.isnan(high):
            continue
        while high - low > tolerance * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if np.abs(multipliers(middle)).max() > 1 else (middle, high)
        values = multipliers(high)
        critical = complex(values[np.argmax(np.abs(values))])
        limits[k] = 0.5 * (low + high)
        kinds[k] = _kind(critical)
        chatter[k] = _frequency(system, critical, period)
    return StabilityLobes(speeds, limits, chatter, tuple(kinds), "semi-discretization", warnings)


def mean_directional_matrices(process: MillingProcess, steps: int) -> Real:
    """Mean of alpha over each interval of a tooth period, split exactly at entry and exit, (steps, 3, 3)."""
    pitch = 2 * math.pi / process.teeth
    edges = np.linspace(0, pitch, steps + 1)
    events = [math.fmod(angle, pitch) for angle in (process.start_angle, process.exit_angle)]
    nodes, weights = np.polynomial.legendre.leggauss(_AVERAGE)
    means = np.zeros((steps, 3, 3))
    for i in range(steps):
        inner = sorted(event for event in events if edges[i] < event < edges[i + 1])
        parts = [edges[i], *inner, edges[i + 1]]
        for low, high in pairwise(parts):
            angles = 0.5 * (low + high) + 0.5 * (high - low) * nodes
            share = 0.5 * (high - low) / (edges[1] - edges[0])
            means[i] += share * np.einsum("a,apq->pq", weights, directional_matrix(process, angles))
    return means


def one_period_multipliers(system: DelaySystem, stiffness: Real, period: float, order: int) -> Complex:
    """Floquet multipliers for the force matrices ``a K_tc alpha`` (steps, 3, 3) over a tooth period (s).

    State and tool position at the steps' ends map on those one period later.
    """
    matrix, output = system.state_matrix, system.output_matrix
    steps, n_states = len(stiffness), len(matrix)
    step = period / steps
    width = n_states + 3 * (steps + 1)
    state = np.zeros((n_states, width))
    state[:, :n_states] = np.eye(n_states)
    positions = np.zeros((steps + 1, 3, width))
    positions[0] = output @ state
    free = expm(matrix * step)
    for i in range(steps):
        column = n_states + 3 * i
        if not stiffness[i].any():
            state = free @ state
        else:
            fade, first, second = _step(system, stiffness[i], step, order)
            state = fade @ state
            state[:, column : column + 3] += first
            state[:, column + 3 : column + 6] += second
        positions[i + 1] = output @ state
    monodromy = np.concatenate([state, positions.reshape(-1, width)])
    return np.asarray(np.linalg.eigvals(monodromy), dtype=np.complex128)


def _step(system: DelaySystem, stiffness: Real, step: float, order: int) -> tuple[Real, Real, Real]:
    """One interval: decay of the state, and what the delayed position at its start and end adds."""
    drive = system.input_matrix @ stiffness
    n = len(drive)
    # state, constant input, its slope: one exponential gives all three integrals
    augmented = np.zeros((n + 6, n + 6))
    augmented[:n, :n] = (system.state_matrix + drive @ system.output_matrix) * step
    augmented[:n, n : n + 3] = -drive * step
    augmented[n : n + 3, n + 3 :] = np.eye(3)
    exponential = expm(augmented)
    constant, ramp = exponential[:n, n : n + 3], exponential[:n, n + 3 :]
    if order == 0:
        return exponential[:n, :n], constant / 2, constant / 2
    return exponential[:n, :n], constant - ramp, ramp


def _kind(multiplier: complex) -> str:
    angle = abs(np.angle(multiplier))
    if angle > math.pi - 1e-6:
        return "period-doubling"
    return "fold" if angle < 1e-6 else "hopf"


def _frequency(system: DelaySystem, multiplier: complex, period: float) -> float:
    """Of the lines that the multiplier allows, the one where the tool's receptance is largest, Hz."""
    highest = 1.5 * np.abs(system.poles).max() * period / (2 * math.pi)
    lines = (np.angle(multiplier) + 2 * math.pi * np.arange(-int(highest) - 2, int(highest) + 3)) / period
    direct = np.einsum("rp,kr,rq->kpq", system.right, 1 / (1j * lines[:, None] - system.poles), system.left)
    mirror = np.einsum(
        "rp,kr,rq->kpq", system.right.conj(), 1 / (1j * lines[:, None] - system.poles.conj()), system.left.conj()
    )
    strength = np.linalg.norm(direct + mirror, axis=(1, 2))
    return float(np.abs(lines[np.argmax(strength)]) / (2 * math.pi))
