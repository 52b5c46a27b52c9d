"""The time loop of one joint on a modal structure: free simulation, and a law driven by a given motion. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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


@compiled
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


@compiled
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
