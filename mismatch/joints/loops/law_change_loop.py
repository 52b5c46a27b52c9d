"""What a law's own numbers change of its force at a motion that is given. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

from .joint_loop import cell_of

Real = NDArray[np.float64]
Columns = NDArray[np.float32]


@compiled
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
        Parts of :class:`mismatch.joints.LawSlopes`, and the share of the recording's duration between two
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


@compiled
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
