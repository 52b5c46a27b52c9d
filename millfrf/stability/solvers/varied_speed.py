"""Depth limits at a spindle speed that varies, by Floquet multipliers over the period of teeth and speed.

Over the spindle's angle a varied speed leaves the delay constant, one pitch, and varies the time of a step:

    dq / dtheta = (p q + left F) / Omega(theta),   F = a D(theta) (X(theta) - X(theta - pitch))

(Seguy, Insperger, Arnaud, Dessein & Peigne, Int. J. Adv. Manuf. Technol. 48, 2010, 883-895, who vary it over time).
Modes are exact for a force that is linear over a step. The largest multiplier is found by Arnoldi's method, whose
products with the monodromy matrix are simulations of one period.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real
from millfrf.core.compilation import FORCED, compile_kernels, compiled
from millfrf.cutting import (
    EarlierMotions,
    EdgeForces,
    MillingProcess,
    PieceNodes,
    add_edge_forces,
    edge_slices,
    refuse_varied,
)
from modal_fit import ModalModel

from ..depth_search import limit_between, lowest_bracket
from ..floquet.crossings import safe_depth
from ..lobes_result import StabilityLobes
from ..milling_loop import DelaySystem, delay_system
from ..settings import SETTINGS
from ..speed_variation import SpeedVariation
from .zero_order import checked_speeds

KRYLOV = 24  # vectors of Arnoldi's method
FINER = 1.5  # ratio of steps with which a limit is checked
ANGLES = 16  # angles of a step over which the cutting stiffness is averaged


@dataclass(frozen=True)
class _Period:
    """One period of teeth and speed: factors of each of its ``n`` steps."""

    decay: Complex  # (n, n_modes): of the modal coordinates
    begin: Complex  # (n, n_modes): by the force at the beginning of the step, s
    end: Complex  # (n, n_modes): by the force at its end, s
    compliance: Real  # (n, 3, 3), m/N: motion at the end of the step per force there
    angle_step: float  # rad
    steps: int  # in a pitch


def varied_speed_limits(
    model: ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float, variation: SpeedVariation
) -> StabilityLobes:
    """Compute the lowest depth limit at each mean spindle speed while the speed varies.

    Depths are searched as for cutters of any shape (``lowest_bracket``), and half as many steps again must find the
    same limit within 1 %. The errors of the model are not in the limits: their status is ``not-verified``.

    Parameters
    ----------
    model
        Receptance in m/N at the tool.
    process
        Cutter and engagement: a cylinder with equal pitch, with or without helix.
    spindle_speeds : (n_speeds,), rad/s
        Mean spindle speeds.
    max_depth : m
        Largest axial depth that is searched.
    variation
        Variation of the speed.

    Raises
    ------
    InputError
        A cutter of another shape, or a variation that does not repeat together with the teeth.
    """
    system, speeds = _checked(model, process), checked_speeds(spindle_speeds, max_depth)
    limits = [_lowest(system, float(speed), max_depth, variation) for speed in speeds]
    status = tuple("unresolved" if np.isnan(depth) else "not-verified" for depth in limits)
    warning = (
        "at a varied speed, errors of the model and modes that were not measured are not in the limits; compare with "
        "the limits at constant speed"
    )
    return StabilityLobes(
        speeds,
        np.array(limits),
        np.full(len(speeds), np.nan),
        ("none",) * len(speeds),
        "varied speed",
        (*system.warnings, warning),
        status,
    )


def varied_speed_radius(
    model: ModalModel, process: MillingProcess, spindle_speed: float, depth: float, variation: SpeedVariation
) -> float:
    """Compute the modulus of the largest Floquet multiplier over the period of teeth and speed.

    Parameters are as for :func:`varied_speed_limits`; ``depth`` in m.

    Raises
    ------
    InputError
        As :func:`varied_speed_limits`, or Arnoldi's method does not converge.
    """
    system = _checked(model, process)
    try:
        return _radius(system, _period(system, spindle_speed, variation), depth)
    except scipy.sparse.linalg.ArpackError as error:
        raise InputError(
            f"the multipliers at {spindle_speed * 30 / np.pi:.4g} rpm do not converge; change speed or depth a little"
        ) from error


def _checked(model: ModalModel, process: MillingProcess) -> DelaySystem:
    refuse_varied(
        process, "a limit at a varied speed", "give equal teeth, or use millfrf cut simulate", takes=("helix",)
    )
    compile_kernels(*FORCED)
    return delay_system(model, process)


def _lowest(system: DelaySystem, speed: float, max_depth: float, variation: SpeedVariation) -> float:
    """Return the lowest limit, m; infinite: none up to ``max_depth``; NaN: not found."""
    scale = 1.0
    for _ in range(3):
        growth = _growth_at(system, _period(system, speed, variation, scale))
        try:
            low, high = lowest_bracket(growth, min(safe_depth(system), max_depth), max_depth)
            if np.isinf(high.depth):
                return np.inf
            if low.depth > 0:
                limit = limit_between(growth, low, high)
                finer = _growth_at(system, _period(system, speed, variation, FINER * scale))
                if finer(0.99 * limit) < 0 < finer(1.01 * limit):
                    return limit
        except scipy.sparse.linalg.ArpackError:  # the multipliers do not converge with these steps
            pass
        scale *= FINER
    return np.nan


def _growth_at(system: DelaySystem, period: _Period) -> Callable[[float], float]:
    """Return the logarithm of the largest multiplier's modulus as a function of the depth (m)."""
    return lambda depth: float(np.log(max(_radius(system, period, depth), 1e-300)))


def _period(system: DelaySystem, speed: float, variation: SpeedVariation, scale: float = 1.0) -> _Period:
    """Prepare the steps of one period, ``scale`` times as many as the highest mode needs."""
    teeth = system.process.teeth
    highest, slowest = float(np.abs(system.poles).max()), speed * (1 - variation.amplitude)
    steps = int(np.ceil(scale * max(SETTINGS.steps_per_tooth, SETTINGS.steps_per_period * highest / slowest / teeth)))
    count, step = steps * variation.tooth_passings(teeth), 2 * np.pi / teeth / steps
    if count > SETTINGS.most_instants // 100:
        raise InputError(
            f"{count} steps in a period of the varied speed at {speed * 30 / np.pi:.4g} rpm are too many; give a "
            "higher speed, or a model without modes far above the tooth passing"
        )
    middles = np.asarray((np.arange(count) + 0.5) * step, dtype=float)
    z = system.poles * variation.durations(middles, step, speed)[:, None]
    decay = np.exp(z)
    end = (decay - 1 - z) / (system.poles * z)
    compliance = 2 * np.real(np.einsum("kr,rp,rq->kpq", end, system.right, system.left)) + system.upper
    return _Period(decay, (decay - 1) / system.poles - end, end, compliance, step, steps)


def _radius(system: DelaySystem, period: _Period, depth: float) -> float:
    """Return the modulus of the largest multiplier; the state is q and the motion of the last pitch."""
    forces = _forces(system, period, depth)
    left, right = (np.ascontiguousarray(part, dtype=complex) for part in (system.left, system.right))
    upper = np.ascontiguousarray(system.upper, dtype=float)
    size = 2 * len(system.poles) + 3 * period.steps

    def passed(vector: Real) -> Real:
        state = np.array(vector, dtype=float).ravel()
        _pass_period(period.decay, period.begin, period.end, *forces, left, right, upper, state)
        return state

    operator = scipy.sparse.linalg.LinearOperator((size, size), matvec=passed, dtype=float)
    start = np.random.default_rng(0).standard_normal(size)
    values = scipy.sparse.linalg.eigs(
        operator, k=1, ncv=min(KRYLOV, size - 1), v0=start, tol=1e-6, return_eigenvectors=False
    )
    return float(np.abs(values).max())


def _forces(system: DelaySystem, period: _Period, depth: float) -> tuple[Real, Real]:
    """Return the force at the beginning and at the end of each step per motion less that a pitch ago.

    The first, ``(I - a D U)^-1 a D`` of each step of a pitch, is per motion of the modes at that instant; the second,
    ``(I - a D S)^-1 a D`` of all steps with the ``compliance`` S, per motion that the modes would have without this
    force.
    """
    stiffness = _mean_stiffness(system.process, period, depth)
    later = stiffness[(np.arange(len(period.compliance)) + 1) % period.steps]
    now = np.asarray(np.linalg.solve(np.eye(3) - stiffness @ system.upper, stiffness), dtype=float)
    return now, np.asarray(np.linalg.solve(np.eye(3) - later @ period.compliance, later), dtype=float)


def _mean_stiffness(process: MillingProcess, period: _Period, depth: float) -> Real:
    """Return the cutting stiffness ``a D`` at the steps of a pitch, N/m, (steps, 3, 3), averaged over a step."""
    inside = (np.arange(ANGLES) + 0.5) / ANGLES - 0.5
    angles = np.asarray(period.angle_step * (np.arange(period.steps)[:, None] + inside).ravel(), dtype=float)
    cutting, normals, none = np.zeros((len(angles), 3, 3)), np.zeros((len(angles), 3, 3)), np.zeros(1)
    # the earlier motion acts with the same matrix a pitch later, so that its blocks are not needed
    add_edge_forces(
        angles,
        edge_slices(process, depth),
        EdgeForces.of(process),
        PieceNodes(none, none, 2 * np.pi, none, none),
        cutting,
        normals,
        EarlierMotions.empty(len(angles), 1, 0, np.arange(3), np.arange(3)),
    )
    return np.asarray(cutting.reshape(period.steps, ANGLES, 3, 3).mean(axis=1), dtype=float)


def _example() -> tuple[Any, ...]:
    modes, matrices, vectors = np.zeros((1, 1), dtype=complex), np.zeros((1, 3, 3)), np.zeros((1, 3), dtype=complex)
    return modes, modes, modes, matrices, matrices, vectors, vectors, np.zeros((3, 3)), np.zeros(5)


@compiled(example=_example)
def _pass_period(
    decay: Complex,
    begin: Complex,
    end: Complex,
    now: Real,
    later: Real,
    left: Complex,
    right: Complex,
    upper: Real,
    state: Real,
) -> None:
    """Move the state by one period: real, then imaginary parts of q, then the motion at the steps of the last pitch."""
    n, steps = len(left), len(now)
    q = state[:n] + 1j * state[n : 2 * n]
    past = state[2 * n :].reshape((steps, 3))
    moved, chip, force = np.empty(3), np.empty(3), np.empty(3)
    _move(q, right, moved)
    for a in range(3):
        chip[a] = moved[a] - past[0, a]
    _multiply(now[0], chip, force)
    for k in range(len(decay)):
        _multiply(upper, force, past[k % steps])
        for a in range(3):
            past[k % steps, a] += moved[a]
        for r in range(n):
            q[r] = decay[k, r] * q[r] + begin[k, r] * _pushed(left[r], force)
        _move(q, right, moved)
        for a in range(3):
            chip[a] = moved[a] - past[(k + 1) % steps, a]
        _multiply(later[k], chip, force)
        for r in range(n):
            q[r] += end[k, r] * _pushed(left[r], force)
        _move(q, right, moved)
    state[:n], state[n : 2 * n] = q.real, q.imag


@compiled
def _pushed(left: Complex, force: Real) -> complex:
    return complex(left[0] * force[0] + left[1] * force[1] + left[2] * force[2])


@compiled
def _move(q: Complex, right: Complex, out: Real) -> None:
    """Write the tool's motion by the modes."""
    for a in range(3):
        out[a] = 0.0
        for r in range(len(q)):
            out[a] += 2.0 * (q[r] * right[r, a]).real


@compiled
def _multiply(matrix: Real, vector: Real, out: Real) -> None:
    for a in range(3):
        out[a] = matrix[a, 0] * vector[0] + matrix[a, 1] * vector[1] + matrix[a, 2] * vector[2]
