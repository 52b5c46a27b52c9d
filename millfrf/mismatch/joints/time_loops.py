"""Compiled time loops of joints on modal structures, of their laws and of modal filters."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled, inner_loop

Columns = NDArray[np.float32]

MOMENTS = 2  # moments of a force over a step: two leave an error of 2e-4 for the fastest mode that is followed


@inner_loop
def cell_of(at: float, reach: float, per_unit: float, cells: int) -> int:
    """Return the cell of an evenly spaced table over [-reach, reach] with ``per_unit`` cells per unit."""
    return int(min(max((at + reach) * per_unit, 0.0), cells - 1.0))


@inner_loop
def look_up(table: Real, reach: float, at: float) -> tuple[float, float]:
    """Return value and slope of an evenly spaced table over [-reach, reach], linear beyond its ends."""
    cells = (len(table) - 1) / (2.0 * reach)
    k = cell_of(at, reach, cells, len(table) - 1)
    rise = table[k + 1] - table[k]
    return table[k] + ((at + reach) * cells - k) * rise, rise * cells


@inner_loop
def balanced(
    free: tuple[float, float, float],
    own: tuple[float, float],
    table_x: Real,
    table_v: Real,
    first: tuple[int, int],
    cells: tuple[int, int],
    spans: tuple[float, float],
    ramp: float,
    springs: Real,
    yields: Real,
    stretch: Real,
    elements: tuple[int, int],
    last_x: float,
) -> tuple[float, float, float]:
    """Return force, deflection and velocity of a joint at one instant, by Newton's method.

    ``free`` holds deflection and velocity without the force at this instant, and a force to start from; ``own`` the
    deflection and velocity that a unit of the force takes away at once; ``last_x`` the deflection one instant before.
    The law's tables begin at the points ``first`` of ``table_x`` and ``table_v`` and have ``cells`` cells over the
    ``spans``; ``elements`` are its first elastic-plastic element and the one after its last.
    """
    # whole arrays are passed, and read in place: a part of an array, or a tuple with arrays, would be counted as a new
    # reference, by an atomic operation that takes longer than the arithmetic
    x_free, v_free, g = free
    own_x, own_v = own
    reach, speed = spans
    per_x, per_v = cells[0] / (2.0 * reach), cells[1] / (2.0 * speed)
    x, v = x_free - own_x * g, v_free - own_v * g
    i, j = cell_of(x, reach, per_x, cells[0]), cell_of(v, speed, per_v, cells[1])
    for _ in range(8):
        low_x, low_v = table_x[first[0] + i], table_v[first[1] + j]
        rise, climb = table_x[first[0] + i + 1] - low_x, table_v[first[1] + j + 1] - low_v
        value = low_x + ((x + reach) * per_x - i) * rise + ramp * x
        value += low_v + ((v + speed) * per_v - j) * climb
        slope_x, slope_v = rise * per_x + ramp, climb * per_v
        for e in range(elements[0], elements[1]):
            trial = stretch[e] + x - last_x
            if abs(trial) > yields[e]:
                value += springs[e] * (yields[e] if trial > 0 else -yields[e])
            else:
                value += springs[e] * trial
                slope_x += springs[e]
        slope = 1.0 + own_x * slope_x + own_v * slope_v
        # the bound keeps steps finite if the force falls with the deflection and the equation is almost singular
        change = (value - g) / max(0.2, slope)
        g += change
        x, v = x_free - own_x * g, v_free - own_v * g
        if abs(change) < 1e-9 * (abs(g) + 1e-6):
            break
        old_i, old_j = i, j
        i, j = cell_of(x, reach, per_x, cells[0]), cell_of(v, speed, per_v, cells[1])
        # on one linear piece of the law, and without elements that may yield, a full step is exact
        if elements[0] == elements[1] and slope > 0.2 and i == old_i and j == old_j:
            break
    return g, x, v


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
    """Simulate a joint together with its structure and write the joint's force and motion at every instant.

    The deflection is ``x = x_driven - (h * g)`` with the structure's impulse response h along the joint, exact for a
    force g that is linear between instants. Newton's method solves for g at each instant, so that stiff laws (dry
    friction, corners) are stable.

    Parameters
    ----------
    driven, driven_speed : (n,), m, m/s
        Motion along the joint without its force.
    dynamics
        For each mode: ``exp(p h)``, weights of the force at a step's start and end, factors from the modal coordinate
        to deflection and velocity, each (n_modes,).
    tables, spans
        Forces of the law over deflection and velocity, N, at evenly spaced points, and the ends of these axes, m, m/s.
    ramp : (n,), N/m
        Stiffness that changes with time.
    elements
        Springs (N/m) and yields (m) of the elastic-plastic elements, each (n_elements,).
    written
        Receives g (N), deflection (m) and velocity (m/s), each (n,).
    """
    force, deflection, velocity = written
    decay, start, end, to_x, to_v = dynamics
    springs, yields = elements
    stretch = np.zeros(len(springs))
    modes = np.zeros(len(decay), dtype=np.complex128)
    # instantaneous effect of the force on deflection and velocity
    own_x, own_v = 0.0, 0.0
    for r in range(len(decay)):
        own_x += 2.0 * (to_x[r] * end[r]).real
        own_v += 2.0 * (to_v[r] * end[r]).real
    table_x, table_v = tables
    cells, last_x, g = (len(table_x) - 1, len(table_v) - 1), driven[0], 0.0
    for k in range(len(driven)):
        x_free, v_free = driven[k], driven_speed[k]
        for r in range(len(decay)):
            modes[r] = decay[r] * modes[r] - start[r] * g
            x_free += 2.0 * (to_x[r] * modes[r]).real
            v_free += 2.0 * (to_v[r] * modes[r]).real
        g, x, v = balanced(
            (x_free, v_free, g),
            (own_x, own_v),
            table_x,
            table_v,
            (0, 0),
            cells,
            spans,
            ramp[k],
            springs,
            yields,
            stretch,
            (0, len(springs)),
            last_x,
        )
        deflection[k], velocity[k] = x, v
        for i in range(len(springs)):
            stretch[i] = min(max(stretch[i] + x - last_x, -yields[i]), yields[i])
        last_x = x
        for r in range(len(decay)):
            modes[r] -= end[r] * g
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
    """Write the joint's force for a prescribed motion; arguments as for :func:`free_run`."""
    springs, yields = elements
    stretch = np.zeros(len(springs))
    last = deflection[0]
    for k in range(len(deflection)):
        value = look_up(tables[0], spans[0], deflection[k])[0] + look_up(tables[1], spans[1], velocity[k])[0]
        value += ramp[k] * deflection[k]
        for i in range(len(springs)):
            stretch[i] = min(max(stretch[i] + deflection[k] - last, -yields[i]), yields[i])
            value += springs[i] * stretch[i]
        last = deflection[k]
        force[k] = value


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
    """Write the derivative of a law's force by each of its numbers, along a block of a prescribed motion.

    Parameters
    ----------
    motion
        Deflection (m) and velocity (m/s) at each instant, (n,).
    begin
        First instant of the block.
    law
        Ends of the tables' axes, deflection (m) and velocity (m/s), and the elements' yields (m), (n_elements,).
    slopes
        Parts of :class:`millfrf.mismatch.joints.joint_law.LawSlopes`, and the time between two instants over the
        recording's duration.
    memory
        Stretch of each element (m), and direction in which it last slipped (0: never), (n_elements,); updated to the
        end of the block.
    written
        Receives whether each element sticks, (n_block or more, n_elements), and the derivative, (n_block, n_numbers).
    """
    spans, yields = law
    tables, ramp, elements, time_share = slopes
    sticks, out = written
    _stretch(motion[0], begin, yields, elements, memory, sticks, out)
    if np.any(ramp != 0.0):
        _add_ramp(motion[0], begin, ramp, time_share, out)
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
    """Move the elements and write the derivatives by their springs and yields; zeros if there are no elements."""
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
            length, side = np.float32(trial), np.float32(slipped[i])
            for j in range(out.shape[1]):
                out[k, j] += length * by_spring[i, j] + side * by_yield[i, j]


@inner_loop
def _add_ramp(x: Real, begin: int, ramp: Columns, time_share: float, out: Columns) -> None:
    """Add the derivatives by ramp and bend."""
    for k in range(len(out)):
        tau = min((begin + k) * time_share, 1.0) - 0.5
        linear, bent = np.float32(x[begin + k] * tau), np.float32(x[begin + k] * (4.0 * tau * tau - 1.0))
        for j in range(out.shape[1]):
            out[k, j] += linear * ramp[0, j] + bent * ramp[1, j]


@inner_loop
def _add_table(table: Columns, end: float, motion: Real, begin: int, out: Columns) -> None:
    """Add the interpolated row of an evenly spaced table over [-end, end], linear beyond its ends, for each instant."""
    cells = (len(table) - 1) / (2.0 * end)
    for k in range(len(out)):
        at = motion[begin + k]
        cell = cell_of(at, end, cells, len(table) - 1)
        share = np.float32((at + end) * cells - cell)
        for j in range(out.shape[1]):
            out[k, j] += table[cell, j] + share * (table[cell + 1, j] - table[cell, j])


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
    """Step modal filters through a block of instants and write their signals.

    Parameters
    ----------
    sources : (n, n_sources MOMENTS + n_direct)
        Sources of :class:`millfrf.mismatch.joints.tangent_loops.ModalFilters` at all instants.
    begin
        First instant of the block.
    state : (2 n_states,)
        First and second parts of all states, updated to the end of the block.
    parts
        ``turns``, ``inputs`` and ``direct`` of the filters.
    size
        ``n_modes`` and ``step`` of the filters.
    first
        Column of the first signal: all first parts come before all second ones.
    shown
        Receives the signals and, if needed, their time derivatives, (n_block, n_columns).
    """
    dx, dv = shown
    turns, inputs, direct = parts
    n_modes, step = size
    # the compiler vectorises loops (eight columns at once) only over arrays created here, which cannot overlap
    u, v = state[: len(state) // 2].copy(), state[len(state) // 2 :].copy()
    n = len(u)
    signals = n - n_modes
    for k in range(len(dx)):
        if begin + k:
            _step_on(sources, begin + k, u, v, turns, inputs, n_modes, np.float32(step))
        for j in range(signals):
            dx[k, first + j] = u[j]
            dx[k, first + signals + j] = v[j]
        if len(direct):
            _rates(sources, begin + k, u, v, turns, len(inputs), direct, n_modes, first, k, dv)
    state[:n], state[n:] = u, v


@inner_loop
def _step_on(
    sources: Columns,
    k: int,
    u: Columns,
    v: Columns,
    turns: Columns,
    inputs: Columns,
    n_modes: int,
    step: np.float32,
) -> None:
    """Step all states to instant ``k``."""
    n = len(u)
    # the state of the single pole drives the state of the double pole
    for r in range(n - 2 * n_modes, n - n_modes):
        u[r] += step * u[r + n_modes]
        v[r] += step * v[r + n_modes]
    for j in range(n):
        a = turns[0, j] * u[j] + turns[1, j] * v[j]
        b = turns[0, j] * v[j] - turns[1, j] * u[j]
        u[j], v[j] = a, b
    for q in range(0, len(inputs), MOMENTS):
        mean, slope = sources[k, q], sources[k, q + 1]
        for j in range(n):
            u[j] += mean * inputs[q, j] + slope * inputs[q + 1, j]
        for j in range(n):
            v[j] += mean * inputs[q, n + j] + slope * inputs[q + 1, n + j]


@inner_loop
def _rates(
    sources: Columns,
    at: int,
    u: Columns,
    v: Columns,
    turns: Columns,
    n_inputs: int,
    direct: Columns,
    n_modes: int,
    first: int,
    k: int,
    dv: Columns,
) -> None:
    """Write the time derivatives of the signals at instant ``at`` into row ``k``."""
    n = len(u)
    second, signals = first + n - n_modes, n - n_modes
    for j in range(signals):
        dv[k, first + j] = turns[2, j] * u[j] + turns[3, j] * v[j]
        dv[k, second + j] = turns[2, j] * v[j] - turns[3, j] * u[j]
    for r in range(signals - n_modes, signals):
        dv[k, first + r] += u[n_modes + r]
        dv[k, second + r] += v[n_modes + r]
    for q in range(len(direct)):
        force = sources[at, n_inputs + q]
        for j in range(signals):
            dv[k, first + j] += force * direct[q, j]
