"""How a joint on a modal structure answers many small changes at once: the tangent of its free run. Compiled."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled

from .time_loops import filters_run, law_change_run, look_up

Columns = NDArray[np.float32]

PART = 128
"""Instants that are worked through at once: what they need stays in the processor's cache, and calls are few."""

TINY = np.float32(1e-26)
"""Added to each state at each step: a processor is far slower with numbers below 1e-38, to which states ring out."""


@compiled(
    "(UniTuple(float64[::1],2), UniTuple(complex128[::1],5), "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],UniTuple(float32[:,::1],2),float64)), "
    "Tuple((float32[:,::1],float32[::1],UniTuple(float32[:,::1],3),Tuple((int64,float64)))), "
    "UniTuple(float32[:,::1],2), float32[::1], float32[:,::1])",
    "(UniTuple(float64[::1],2), UniTuple(complex128[::1],5), "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],Tuple((float32[:,::1],float32[::1,:])),float64)), "
    "Tuple((float32[:,::1],float32[::1],UniTuple(float32[:,::1],3),Tuple((int64,float64)))), "
    "UniTuple(float32[:,::1],2), float32[::1], float32[:,::1])",
)
def tangent_run(
    motion: tuple[Real, Real],
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    law: tuple[tuple[Real, Real], tuple[float, float], Real, tuple[Real, Real]],
    slopes: tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns], float],
    filters: tuple[Columns, Columns, tuple[Columns, Columns, Columns], tuple[int, float]],
    given: tuple[Columns, Columns],
    weights: Columns,
    force: Columns,
) -> None:
    """Write the change of a joint's force for every column of a change of its law, or of what drives it.

    Along the motion of :func:`millfrf.mismatch.joints.time_loops.free_run`, ``dg = e + g_x dx + g_v dv + memory`` with
    ``dx = dx_driven - (h * dg)``: linear, but with slopes that change from instant to instant. An element that sticks
    since an instant ``t_i`` adds ``k_i (dx - dx(t_i))``, one that slips nothing.

    Parameters
    ----------
    motion
        Deflection (m) and velocity (m/s) of the free run, each (n,).
    dynamics
        Argument of the free run, at this run's step.
    law
        Tables, spans, ramp and elements of the free run.
    slopes
        Change e of the law: parts of :class:`millfrf.mismatch.joints.joint_law.LawSlopes`, and the share of the
        recording's
        duration between two instants. These columns come first.
    filters
        Sources, start, ``turns`` with ``inputs`` and ``direct``, ``n_modes`` with ``step`` of
        :class:`millfrf.mismatch.joints.modal_filters.ModalFilters`: changes of the driven motion that are modal
        filters.
        These columns come next.
    given
        Other changes of the driven deflection (m) and velocity (m/s), each (n, n_given). These columns come last.
    weights : (2 often - 1,)
        Weights of the instants around one that is written.
    force : (n // often, n_columns), N
        Receives dg at every ``often``-th instant, the weighted mean of those around it.
    """
    spans, elements = law[1], law[3]
    state, numbers, n_columns = filters[1].copy(), slopes[1].shape[1], force.shape[1]
    n, n_elements = (len(weights) + 1) // 2 * len(force), len(elements[0])
    factors, own = _step_factors(dynamics)
    modes, rows = np.zeros((2, len(factors), n_columns), np.float32), np.zeros((3, n_columns), np.float32)
    changes, e = np.zeros((2, PART, n_columns), np.float32), np.zeros((PART, numbers), np.float32)
    gains, sticks = np.zeros((PART, 4), np.float32), np.ones((PART, n_elements), dtype=np.bool_)
    memory, held = (np.zeros(n_elements), np.zeros(n_elements)), np.zeros((n_elements, n_columns), np.float32)
    elastic = (elements[0], sticks, np.ones(n_elements, dtype=np.bool_), held)
    force[:] = 0.0
    for begin in range(0, n, PART):
        count = min(PART, n - begin)
        dx, dv = changes[0, :count], changes[1, :count]
        law_change_run(motion, begin, (spans, elements[1]), slopes, memory, (sticks, e[:count]))
        _slopes(motion, begin, law, sticks, own, gains[:count])
        filters_run(filters[0], begin, state, filters[2], filters[3], numbers, (dx, dv))
        _write_others(given, begin, numbers, (dx, dv))
        _answer(factors, gains, e, (dx, dv), (modes[0], modes[1], rows), elastic, len(filters[2][2]) > 0)
        _write(dx, weights, begin, force)


@compiled(
    "(UniTuple(float64[::1],2), int64, "
    "Tuple((UniTuple(float64[::1],2),UniTuple(float64,2),float64[::1],UniTuple(float64[::1],2))), "
    "bool[:,::1], UniTuple(float64,2), float32[:,::1])",
)
def _slopes(
    motion: tuple[Real, Real],
    begin: int,
    law: tuple[tuple[Real, Real], tuple[float, float], Real, tuple[Real, Real]],
    sticks: NDArray[np.bool_],
    own: tuple[float, float],
    out: Columns,
) -> None:
    """Write the law's slopes at each instant: by deflection, velocity, what is left of a force, and its own way."""
    tables, spans, ramp, elements = law
    for k in range(len(out)):
        slope_x = look_up(tables[0], spans[0], motion[0][begin + k])[1] + ramp[begin + k]
        slope_v = look_up(tables[1], spans[1], motion[1][begin + k])[1]
        for i in range(sticks.shape[1]):
            if sticks[k, i]:
                slope_x += elements[0][i]
        whole = 1.0 / max(0.2, 1.0 + own[0] * slope_x + own[1] * slope_v)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = slope_x, slope_v, whole, own[0]


@compiled
def _write_others(given: tuple[Columns, Columns], begin: int, numbers: int, changes: tuple[Columns, Columns]) -> None:
    """Write the driven motion of the law's own columns, which is none, and of the last ones."""
    for side in range(2):
        change, known = changes[side], given[side]
        first = change.shape[1] - known.shape[1]
        for k in range(len(change)):
            for j in range(numbers):
                change[k, j] = 0.0
            for j in range(known.shape[1]):
                change[k, first + j] = known[begin + k, j]


@compiled
def _step_factors(dynamics: tuple[Complex, Complex, Complex, Complex, Complex]) -> tuple[Columns, tuple[float, float]]:
    """Factors of one step of each mode, and what a force itself does to deflection and velocity at once.

    They are as precise as the columns: mixed kinds of numbers take twice the time.
    """
    turn, early, late, to_x, to_v = dynamics
    factors = np.empty((len(turn), 8), np.float32)
    own_x, own_v = 0.0, 0.0
    for r in range(len(turn)):
        own_x += 2.0 * (to_x[r] * late[r]).real
        own_v += 2.0 * (to_v[r] * late[r]).real
        # the end of the last step and the beginning of this one push with the same force
        push = early[r] + turn[r] * late[r]
        factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3] = turn[r].real, turn[r].imag, push.real, push.imag
        factors[r, 4], factors[r, 5] = 2.0 * to_x[r].real, 2.0 * to_x[r].imag
        factors[r, 6], factors[r, 7] = 2.0 * to_v[r].real, 2.0 * to_v[r].imag
    return factors, (own_x, own_v)


@compiled(
    "(float32[:,::1], float32[:,::1], float32[:,::1], UniTuple(float32[:,::1],2), "
    "UniTuple(float32[:,::1],3), Tuple((float64[::1],bool[:,::1],bool[::1],float32[:,::1])), bool)",
)
def _answer(
    factors: Columns,
    gains: Columns,
    e: Columns,
    changes: tuple[Columns, Columns],
    state: tuple[Columns, Columns, Columns],
    elements: tuple[Real, NDArray[np.bool_], NDArray[np.bool_], Columns],
    rates: bool,
) -> None:
    """Overwrite the driven change of the deflection by the change of the force, instant by instant.

    ``state`` are both parts of the modes, and rows: the force's change before, its memory, and the deflection's change
    before. They are copied: only what a function itself has made is known to lie apart, and then a loop runs over
    eight columns at once.
    """
    real, imaginary, rows = state[0].copy(), state[1].copy(), state[2]
    x, v = np.zeros_like(rows[0]), np.zeros_like(rows[0])
    g, memory, last = rows[0].copy(), rows[1].copy(), rows[2].copy()
    n_columns = len(g)
    for k in range(len(changes[0])):
        if len(elements[0]):
            _slip(elements, k, memory, last)
        x[:], v[:] = changes[0][k], changes[1][k]
        for r in range(len(factors)):
            turn, across, push, pull = factors[r, 0], factors[r, 1], factors[r, 2], factors[r, 3]
            x_real, x_imaginary, v_real, v_imaginary = factors[r, 4], factors[r, 5], factors[r, 6], factors[r, 7]
            one, other = real[r], imaginary[r]
            # written out here: in a function of its own the loop does not run over eight columns at once
            for j in range(n_columns):
                a = turn * one[j] - across * other[j] - push * g[j] + TINY
                b = across * one[j] + turn * other[j] - pull * g[j]
                one[j], other[j] = a, b
                x[j] += x_real * a - x_imaginary * b
            if rates:
                for j in range(n_columns):
                    v[j] += v_real * one[j] - v_imaginary * other[j]
        slope_x, slope_v, whole, own = gains[k, 0], gains[k, 1], gains[k, 2], gains[k, 3]
        for j in range(n_columns):
            g[j] = (slope_x * x[j] + slope_v * v[j] - memory[j]) * whole
        for j in range(e.shape[1]):
            g[j] += e[k, j] * whole
        for j in range(n_columns):
            last[j] = x[j] - own * g[j]
            changes[0][k, j] = g[j]
    state[0][:], state[1][:] = real, imaginary
    rows[0], rows[1], rows[2] = g, memory, last


@compiled
def _slip(
    elements: tuple[Real, NDArray[np.bool_], NDArray[np.bool_], Columns],
    k: int,
    memory: NDArray[np.float32],
    last: NDArray[np.float32],
) -> None:
    """Keep for each element that begins to stick what the change was when it last slipped; forget it where it slips."""
    springs, sticks, stuck, held = elements
    for i in range(len(springs)):
        spring = np.float32(springs[i])
        if sticks[k, i] and not stuck[i]:
            for j in range(len(last)):
                held[i, j] = last[j]
                memory[j] += spring * last[j]
        elif stuck[i] and not sticks[k, i]:
            for j in range(len(last)):
                memory[j] -= spring * held[i, j]
        stuck[i] = sticks[k, i]


@compiled
def _write(dg: Columns, weights: Columns, begin: int, force: Columns) -> None:
    """Add a part's instants to those at the recording's rate before and behind them."""
    often = (len(weights) + 1) // 2
    for k in range(len(dg)):
        row, past = (begin + k) // often, (begin + k) % often
        weight = weights[past + often - 1]
        for j in range(dg.shape[1]):
            force[row, j] += weight * dg[k, j]
        if past and row + 1 < len(force):
            weight = weights[past - 1]
            for j in range(dg.shape[1]):
                force[row + 1, j] += weight * dg[k, j]
