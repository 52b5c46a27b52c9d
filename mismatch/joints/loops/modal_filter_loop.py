"""Steps of modal filters from instant to instant, and the signals that they give. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

Columns = NDArray[np.float32]

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
        Sources of :class:`mismatch.joints.ModalFilters` at all instants.
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
