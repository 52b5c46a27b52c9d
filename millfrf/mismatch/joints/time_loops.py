"""Time loops of joints on modal structures, of their laws and of modal filters; compiled."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled


@compiled
def cell_of(table: NDArray[np.floating], cells: float, reach: float, at: float) -> int:
    """Cell of an evenly spaced table over [-reach, reach], ``cells`` of which are one unit long."""
    return int(min(max((at + reach) * cells, 0.0), len(table) - 2.0))


@compiled
def look_up(table: Real, reach: float, at: float) -> tuple[float, float]:
    """Value and slope of an evenly spaced table over [-reach, reach], straight beyond its ends."""
    # a loop that always looks into the same table works this out once
    cells = (len(table) - 1) / (2.0 * reach)
    k = cell_of(table, cells, reach, at)
    rise = table[k + 1] - table[k]
    return table[k] + ((at + reach) * cells - k) * rise, rise * cells


@compiled
def elements_force(springs: Real, yields: Real, stretch: Real, moved: float) -> tuple[float, float]:
    """Force and stiffness of elastic-plastic elements that move on by ``moved`` from where they are stretched."""
    value, stiffness = 0.0, 0.0
    for i in range(len(springs)):
        trial = stretch[i] + moved
        if abs(trial) > yields[i]:
            value += springs[i] * yields[i] * (1.0 if trial > 0 else -1.0)
        else:
            value += springs[i] * trial
            stiffness += springs[i]
    return value, stiffness


@compiled
def _same_cell(table: Real, cells: float, reach: float, one: float, other: float) -> bool:
    """Whether a table is straight between two places."""
    return cell_of(table, cells, reach, one) == cell_of(table, cells, reach, other)


@compiled(
    "(float64[::1], float64[::1], UniTuple(complex128[::1],5), UniTuple(float64[::1],2), "
    "UniTuple(float64,2), float64[::1], UniTuple(float64[::1],2), UniTuple(float64[::1],3))",
)
def free_run(
    driven: Real,
    driven_speed: Real,
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    tables: tuple[Real, Real],
    spans: tuple[float, float],
    ramp: Real,
    elements: tuple[Real, Real],
    written: tuple[Real, Real, Real],
) -> None:
    """Write the joint's force and motion at every instant, the structure moving under it.

    The deflection is ``x = x_driven - (h * g)``, h the structure's impulse response along the joint, exact for a force
    that runs straight between instants; at each instant g is solved for by Newton's method, so that stiff laws
    (dry friction, corners) stay stable.

    Parameters
    ----------
    driven, driven_speed : (n,), m, m/s
        Motion along the joint without its force.
    dynamics
        For each mode: ``exp(p h)``, weights of the force at a step's beginning and end, factor from mode to deflection
        and to velocity, each (n_modes,).
    tables
        Force of the law over deflection and over velocity, N, each at evenly spaced points.
    spans
        Ends of the tables' axes: deflection (m) and velocity (m/s).
    ramp : (n,), N/m
        Stiffness that changes with time.
    elements
        Springs (N/m) and yields (m) of the elastic-plastic elements, each (n_elements,).
    written
        Receives g (N), deflection (m) and velocity (m/s), each (n,).
    """
    force, deflection, velocity = written
    turn, early, late, to_x, to_v = dynamics
    springs, yields = elements
    stretch = np.zeros(len(springs))
    modes = np.zeros(len(turn), dtype=np.complex128)
    # what the force of this instant itself does to deflection and velocity
    own_x, own_v = 0.0, 0.0
    for r in range(len(turn)):
        own_x += 2.0 * (to_x[r] * late[r]).real
        own_v += 2.0 * (to_v[r] * late[r]).real
    cells_x, cells_v = (len(tables[0]) - 1) / (2.0 * spans[0]), (len(tables[1]) - 1) / (2.0 * spans[1])
    before_x, g = driven[0], 0.0
    for k in range(len(driven)):
        x_free, v_free = driven[k], driven_speed[k]
        for r in range(len(turn)):
            modes[r] = turn[r] * modes[r] - early[r] * g
            x_free += 2.0 * (to_x[r] * modes[r]).real
            v_free += 2.0 * (to_v[r] * modes[r]).real
        x, v = x_free - own_x * g, v_free - own_v * g
        for _ in range(8):
            value, slope_x = look_up(tables[0], spans[0], x)
            damping, slope_v = look_up(tables[1], spans[1], v)
            held, stiff = elements_force(springs, yields, stretch, x - before_x)
            whole = 1.0 + own_x * (slope_x + ramp[k] + stiff) + own_v * slope_v
            change = (value + damping + ramp[k] * x + held - g) / max(0.2, whole)
            g += change
            at_x, at_v = x, v
            x, v = x_free - own_x * g, v_free - own_v * g
            if abs(change) < 1e-9 * (abs(g) + 1e-6):
                break
            # on one straight piece of the law, and without elements that may yield, a whole step is exact
            exact = len(springs) == 0 and whole > 0.2 and _same_cell(tables[0], cells_x, spans[0], at_x, x)
            if exact and _same_cell(tables[1], cells_v, spans[1], at_v, v):
                break
        deflection[k], velocity[k] = x, v
        for i in range(len(springs)):
            stretch[i] = min(max(stretch[i] + x - before_x, -yields[i]), yields[i])
        before_x = x
        for r in range(len(turn)):
            modes[r] -= late[r] * g
        force[k] = g


@compiled(
    "(float64[::1], float64[::1], UniTuple(float64[::1],2), UniTuple(float64,2), float64[::1], "
    "UniTuple(float64[::1],2), float64[::1])",
    "(float64[:], float64[:], UniTuple(float64[::1],2), UniTuple(float64,2), float64[::1], "
    "UniTuple(float64[::1],2), float64[::1])",
)
def driven_run(
    deflection: Real,
    velocity: Real,
    tables: tuple[Real, Real],
    spans: tuple[float, float],
    ramp: Real,
    elements: tuple[Real, Real],
    force: Real,
) -> None:
    """Write the joint's force for a motion that is given; arguments as for :func:`free_run`."""
    springs, yields = elements
    stretch = np.zeros(len(springs))
    before = deflection[0]
    for k in range(len(deflection)):
        value = look_up(tables[0], spans[0], deflection[k])[0] + look_up(tables[1], spans[1], velocity[k])[0]
        value += ramp[k] * deflection[k]
        for i in range(len(springs)):
            stretch[i] = min(max(stretch[i] + deflection[k] - before, -yields[i]), yields[i])
            value += springs[i] * stretch[i]
        before = deflection[k]
        force[k] = value


Columns = NDArray[np.float32]


@compiled(
    "(UniTuple(float64[::1],2), int64, Tuple((UniTuple(float64,2),float64[::1])), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],UniTuple(float32[:,::1],2),float64)), "
    "UniTuple(float64[::1],2), Tuple((bool[:,::1],float32[:,::1])))",
    "(UniTuple(float64[::1],2), int64, Tuple((UniTuple(float64,2),float64[::1])), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],Tuple((float32[:,::1],float32[::1,:])),float64)), "
    "UniTuple(float64[::1],2), Tuple((bool[:,::1],float32[:,::1])))",
    "(UniTuple(float64[:],2), int64, Tuple((UniTuple(float64,2),float64[::1])), "
    "Tuple((UniTuple(float32[:,::1],2),float32[:,::1],UniTuple(float32[:,::1],2),float64)), "
    "UniTuple(float64[::1],2), Tuple((bool[:,::1],float32[:,::1])))",
)
def law_change_run(
    motion: tuple[Real, Real],
    begin: int,
    law: tuple[tuple[float, float], Real],
    slopes: tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns], float],
    memory: tuple[Real, Real],
    written: tuple[NDArray[np.bool_], Columns],
) -> None:
    """Write the change of a law's force along a part of a motion by each of its numbers.

    Parameters
    ----------
    motion
        Deflection (m) and velocity (m/s) at each instant, (n,).
    begin
        The first instant of the part.
    law
        Ends of the tables' axes, deflection (m) and velocity (m/s), and the elements' yields (m), (n_elements,).
    slopes
        Parts of :class:`millfrf.mismatch.joints.joint_law.LawSlopes`, and the share of the recording's duration
        between two
        instants.
    memory
        How far each element is stretched (m), and the direction in which it last slipped (0: never), (n_elements,);
        brought forward to the part's end.
    written
        Receive whether each element sticks, (n_part or more, n_elements), and the change, (n_part, n_numbers), N by
        a coordinate.
    """
    spans, yields = law
    tables, ramp, elements, passing = slopes
    sticks, out = written
    _stretch(motion[0], begin, yields, elements, memory, sticks, out)
    if np.any(ramp != 0.0):
        _add_ramp(motion[0], begin, ramp, passing, out)
    for side in range(2):
        if len(tables[side]):
            _add_table(tables[side], spans[side], motion[side], begin, out)


@compiled(
    "(float64[::1], int64, float64[::1], UniTuple(float32[:,::1],2), UniTuple(float64[::1],2), "
    "bool[:,::1], float32[:,::1])",
    "(float64[::1], int64, float64[::1], Tuple((float32[:,::1],float32[::1,:])), "
    "UniTuple(float64[::1],2), bool[:,::1], float32[:,::1])",
    "(float64[:], int64, float64[::1], UniTuple(float32[:,::1],2), UniTuple(float64[::1],2), "
    "bool[:,::1], float32[:,::1])",
)
def _stretch(
    x: Real,
    begin: int,
    yields: Real,
    slopes: tuple[Columns, Columns],
    memory: tuple[Real, Real],
    sticks: NDArray[np.bool_],
    out: Columns,
) -> None:
    """Stretch the elements on, and write what their springs and yields change; nothing where there are none."""
    stretch, slipped = memory
    by_spring, by_yield = slopes
    for k in range(len(out)):
        moved = x[begin + k] - x[max(begin + k - 1, 0)]
        for j in range(out.shape[1]):
            out[k, j] = 0.0
        for i in range(len(yields)):
            trial = stretch[i] + moved
            sticks[k, i] = abs(trial) <= yields[i]
            if not sticks[k, i]:
                slipped[i] = 1.0 if trial > 0 else -1.0
                trial = slipped[i] * yields[i]
            stretch[i] = trial
            far, side = np.float32(trial), np.float32(slipped[i])
            for j in range(out.shape[1]):
                out[k, j] += far * by_spring[i, j] + side * by_yield[i, j]


@compiled
def _add_ramp(x: Real, begin: int, ramp: Columns, passing: float, out: Columns) -> None:
    """Add what changes of a stiffness with time, straight and bent, do to the force."""
    for k in range(len(out)):
        tau = min((begin + k) * passing, 1.0) - 0.5
        straight, bent = np.float32(x[begin + k] * tau), np.float32(x[begin + k] * (4.0 * tau * tau - 1.0))
        for j in range(out.shape[1]):
            out[k, j] += straight * ramp[0, j] + bent * ramp[1, j]


@compiled
def _add_table(table: Columns, end: float, motion: Real, begin: int, out: Columns) -> None:
    """Add rows of an evenly spaced table over [-end, end], between its points and straight beyond its ends."""
    cells = (len(table) - 1) / (2.0 * end)
    for k in range(len(out)):
        at = motion[begin + k]
        cell = cell_of(table, cells, end, at)
        share = np.float32((at + end) * cells - cell)
        for j in range(out.shape[1]):
            out[k, j] += table[cell, j] + share * (table[cell + 1, j] - table[cell, j])


MOMENTS = 2
"""Moments of a force over a step: two leave 2e-4 of the fastest mode that is followed, and less of a slower one."""


@compiled
def filters_run(
    sources: Columns,
    begin: int,
    state: Columns,
    parts: tuple[Columns, Columns, Columns],
    size: tuple[int, float],
    first: int,
    shown: tuple[Columns, Columns],
) -> None:
    """Step modal filters on through a part of the instants, and write their signals.

    Parameters
    ----------
    sources : (n, n_sources MOMENTS + n_direct)
        Sources of :class:`millfrf.mismatch.joints.modal_filters.ModalFilters` at all instants.
    begin
        The first instant of the part.
    state : (2 n_states,)
        Both parts of all states, brought forward to the part's end.
    parts
        ``turns``, ``inputs`` and ``direct`` of the filters.
    size
        ``n_modes`` and ``step`` of the filters.
    first
        Column of the first signal: all first parts come first, then all second ones.
    shown
        Receive the signals and, where they are wanted, their rates, (n_part, n_columns).
    """
    dx, dv = shown
    # only what a function itself has made is known to lie apart, and then a loop runs over eight columns at once
    one, other = state[: len(state) // 2].copy(), state[len(state) // 2 :].copy()
    n = len(one)
    signals = n - size[0]
    for k in range(len(dx)):
        if begin + k:
            _step_on(sources, begin + k, (one, other), parts, size)
        for j in range(signals):
            dx[k, first + j] = one[j]
            dx[k, first + signals + j] = other[j]
        if len(parts[2]):
            _rates(sources, begin + k, (one, other), parts, size[0], first, k, dv)
    state[:n], state[n:] = one, other


@compiled
def _step_on(
    sources: Columns,
    k: int,
    state: tuple[Columns, Columns],
    parts: tuple[Columns, Columns, Columns],
    size: tuple[int, float],
) -> None:
    """Step all states on to instant ``k``. A double pole is driven by the single one."""
    one, other = state
    turns, inputs, _ = parts
    n_modes, n = size[0], len(one)
    step = np.float32(size[1])
    for r in range(n - 2 * n_modes, n - n_modes):
        one[r] += step * one[r + n_modes]
        other[r] += step * other[r + n_modes]
    for j in range(n):
        a = turns[0, j] * one[j] + turns[1, j] * other[j]
        b = turns[0, j] * other[j] - turns[1, j] * one[j]
        one[j], other[j] = a, b
    for q in range(0, len(inputs), MOMENTS):
        mean, slope = sources[k, q], sources[k, q + 1]
        for j in range(n):
            one[j] += mean * inputs[q, j] + slope * inputs[q + 1, j]
        for j in range(n):
            other[j] += mean * inputs[q, n + j] + slope * inputs[q + 1, n + j]


@compiled
def _rates(
    sources: Columns,
    at: int,
    state: tuple[Columns, Columns],
    parts: tuple[Columns, Columns, Columns],
    n_modes: int,
    first: int,
    k: int,
    dv: Columns,
) -> None:
    """Write the rates of the signals at an instant into row ``k``."""
    turns, inputs, direct = parts
    one, other = state
    n = len(one)
    second, before = first + n - n_modes, n - n_modes
    for j in range(before):
        dv[k, first + j] = turns[2, j] * one[j] + turns[3, j] * other[j]
        dv[k, second + j] = turns[2, j] * other[j] - turns[3, j] * one[j]
    for r in range(before - n_modes, before):
        dv[k, first + r] += one[n_modes + r]
        dv[k, second + r] += other[n_modes + r]
    for q in range(len(direct)):
        force = sources[at, len(inputs) + q]
        for j in range(before):
            dv[k, first + j] += force * direct[q, j]
