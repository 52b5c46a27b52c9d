"""How a joint on a modal structure answers many small changes at once: the tangent of its free run. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

from .joint_loop import look_up

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Columns = NDArray[np.floating]


@compiled
def tangent_run(
    motion: tuple[Real, Real],
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    tables: tuple[Real, Real],
    spans: tuple[float, float],
    ramp: Real,
    elements: tuple[Real, Real],
    change: tuple[Columns, Columns],
    force: Columns,
) -> None:
    """Write the change of a joint's force for every column of a change of what drives it.

    Along the motion of :func:`mismatch.joints.joint_loop.free_run`, ``dg = e + g_x dx + g_v dv + memory`` with
    ``dx = dx_driven - (h * dg)``: linear, but with slopes that change from instant to instant. An element that sticks
    since an instant ``t_i`` adds ``k_i (dx - dx(t_i))``, one that slips nothing.

    Parameters
    ----------
    motion
        Deflection (m) and velocity (m/s) of the free run, each (n,).
    dynamics, tables, spans, ramp, elements
        Arguments of the free run, at this run's step.
    change
        Changes of the driven deflection (m) and velocity (m/s), each (n, n_columns).
    force : (n, n_columns)
        Holds e, the law's own change at this motion; receives dg.
    """
    turn, early, late, to_x, to_v = dynamics
    n_modes, n_columns = len(turn), force.shape[1]
    real, imaginary = np.zeros((n_modes, n_columns), force.dtype), np.zeros((n_modes, n_columns), force.dtype)
    before, held = np.zeros(n_columns, force.dtype), np.zeros(n_columns, force.dtype)
    dx, dv = np.zeros(n_columns, force.dtype), np.zeros(n_columns, force.dtype)
    memory = (np.zeros(len(elements[0])), np.ones(len(elements[0]), dtype=np.bool_))
    stuck_at = np.zeros((len(elements[0]), n_columns), force.dtype)
    own_x, own_v = 0.0, 0.0
    # factors as precise as the columns: mixed kinds of numbers take twice the time
    factors = np.empty((n_modes, 8), force.dtype)
    for r in range(n_modes):
        own_x += 2.0 * (to_x[r] * late[r]).real
        own_v += 2.0 * (to_v[r] * late[r]).real
        # the end of the last step and the beginning of this one push with the same force
        push = early[r] + turn[r] * late[r]
        factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3] = turn[r].real, turn[r].imag, push.real, push.imag
        factors[r, 4], factors[r, 5] = 2.0 * to_x[r].real, 2.0 * to_x[r].imag
        factors[r, 6], factors[r, 7] = 2.0 * to_v[r].real, 2.0 * to_v[r].imag
    own, slopes = np.empty(1, force.dtype), np.empty(3, force.dtype)
    own[0] = own_x
    before_x = motion[0][0]
    for k in range(len(force)):
        x = motion[0][k]
        slope_x = look_up(tables[0], spans[0], x)[1] + ramp[k]
        slope_x += _sticking(elements, memory, x - before_x, dx, (stuck_at, held))
        slope_v = look_up(tables[1], spans[1], motion[1][k])[1]
        before_x = x
        slopes[0], slopes[1] = slope_x, slope_v
        slopes[2] = 1.0 / max(0.2, 1.0 + own_x * slope_x + own_v * slope_v)
        dx[:] = change[0][k]
        dv[:] = change[1][k]
        for r in range(n_modes):
            _advance(factors[r], real[r], imaginary[r], before, dx, dv)
        _answer(slopes, own[0], held, force[k], before, dx, dv)


@compiled
def _answer(
    slopes: Columns, own: float, held: Columns, force: Columns, before: Columns, dx: Columns, dv: Columns
) -> None:
    """Overwrite the law's own change by that of the force, which takes its share of the deflection."""
    slope_x, slope_v, whole = slopes[0], slopes[1], slopes[2]
    for j in range(len(force)):
        dg = (force[j] + slope_x * dx[j] + slope_v * dv[j] - held[j]) * whole
        force[j] = dg
        before[j] = dg
        dx[j] -= own * dg


@compiled
def _sticking(
    elements: tuple[Real, Real],
    memory: tuple[Real, NDArray[np.bool_]],
    moved: float,
    dx: Columns,
    kept: tuple[Columns, Columns],
) -> float:
    """Stiffness of the elements that stick; keeps for each what the change was when it last slipped."""
    springs, yields = elements
    stretch, sticks = memory
    stuck_at, held = kept
    stiffness = 0.0
    for i in range(len(springs)):
        trial = stretch[i] + moved
        stretch[i] = min(max(trial, -yields[i]), yields[i])
        if abs(trial) <= yields[i]:
            stiffness += springs[i]
            if not sticks[i]:
                stuck_at[i] = dx
                held += springs[i] * dx
        elif sticks[i]:
            held -= springs[i] * stuck_at[i]
        sticks[i] = abs(trial) <= yields[i]
    return stiffness


@compiled
def _advance(factors: Columns, real: Columns, imaginary: Columns, before: Columns, dx: Columns, dv: Columns) -> None:
    """One step of one mode for all columns, added to the changes of deflection and velocity."""
    turn, across, push, pull = factors[0], factors[1], factors[2], factors[3]
    x_real, x_imaginary, v_real, v_imaginary = factors[4], factors[5], factors[6], factors[7]
    for j in range(len(before)):
        a = turn * real[j] - across * imaginary[j] - push * before[j]
        b = across * real[j] + turn * imaginary[j] - pull * before[j]
        real[j], imaginary[j] = a, b
        dx[j] += x_real * a - x_imaginary * b
        dv[j] += v_real * a - v_imaginary * b
