"""Compiled time loop of several joints that act on one modal structure at once."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled, inner_loop

from .time_loops import balanced

SWEEPS = 40  # most sweeps over the joints at one instant

SETTLED = 1e-8  # change of a force in a sweep, as a share of it, that ends the sweeps

FORCE, DEFLECTION, VELOCITY, FREE_X, FREE_V, LAST_X = range(6)  # rows of the state of all joints at one instant


@compiled
def _at_once(to: Complex, end: Complex) -> Real:
    """Return the motion of each joint (row) that a unit force of each joint (column) takes away at the same instant."""
    own = np.zeros((len(to), len(to)))
    for i in range(len(to)):
        for j in range(len(to)):
            for r in range(to.shape[1]):
                own[i, j] += 2.0 * (to[i, r] * end[j, r]).real
    return own


@inner_loop
def _balance(
    state: Real,
    own_x: Real,
    own_v: Real,
    table_x: Real,
    table_v: Real,
    spans: Real,
    first: NDArray[np.int64],
    ramps: Real,
    k: int,
    springs: Real,
    yields: Real,
    stretch: Real,
    elements: NDArray[np.int64],
) -> None:
    """Balance the joints in turn, each with the forces of the others held, until no force changes."""
    count = state.shape[1]
    for _ in range(SWEEPS):
        settled = True
        for i in range(count):
            before, x_here, v_here = state[FORCE, i], state[FREE_X, i], state[FREE_V, i]
            for j in range(count):
                if j != i:
                    x_here -= own_x[i, j] * state[FORCE, j]
                    v_here -= own_v[i, j] * state[FORCE, j]
            g, x, v = balanced(
                (x_here, v_here, before),
                (own_x[i, i], own_v[i, i]),
                table_x,
                table_v,
                (first[i, 0], first[i, 1]),
                (first[i + 1, 0] - first[i, 0] - 1, first[i + 1, 1] - first[i, 1] - 1),
                (spans[i, 0], spans[i, 1]),
                ramps[i, k],
                springs,
                yields,
                stretch,
                (elements[i], elements[i + 1]),
                state[LAST_X, i],
            )
            state[FORCE, i], state[DEFLECTION, i], state[VELOCITY, i] = g, x, v
            settled = settled and abs(g - before) <= SETTLED * (abs(g) + 1e-6)
        if settled:
            break


@compiled(
    "(float64[:,::1], float64[:,::1], "
    "Tuple((complex128[::1],complex128[:,::1],complex128[:,::1],complex128[:,::1],complex128[:,::1])), "
    "Tuple((UniTuple(float64[::1],2),float64[:,::1],int64[:,::1])), float64[:,::1], "
    "Tuple((UniTuple(float64[::1],2),int64[::1])), UniTuple(float64[:,::1],3))",
)
def free_runs(
    driven: Real,
    driven_speed: Real,
    dynamics: tuple[Complex, Complex, Complex, Complex, Complex],
    laws: tuple[tuple[Real, Real], Real, NDArray[np.int64]],
    ramps: Real,
    elements: tuple[tuple[Real, Real], NDArray[np.int64]],
    written: tuple[Real, Real, Real],
) -> None:
    """Simulate several joints together with their structure; write force and motion of each at every instant.

    At every instant the joints are balanced in turn (Gauss and Seidel), each as in
    :func:`millfrf.mismatch.joints.time_loops.free_run`, until no force changes. For dry friction this is the projected
    iteration of rigid contacts (Jourdan, Alart & Jean, Comput. Methods Appl. Mech. Eng. 155, 1998).

    Parameters
    ----------
    driven, driven_speed : (n_joints, n), m, m/s
        Motion along each joint without the forces of the joints.
    dynamics
        For each mode: ``exp(p h)``, (n_modes,); for each joint and mode: weights of its force at a step's start and
        end, factors from the modal coordinate to deflection and velocity, each (n_joints, n_modes).
    laws
        Tables of all joints one after the other, ends of their axes, m, m/s, (n_joints, 2), and first point of each
        joint in both tables, (n_joints + 1, 2).
    ramps : (n_joints, n), N/m
        Stiffness that changes with time.
    elements
        Springs (N/m) and yields (m) of all joints one after the other, and the first of each joint, (n_joints + 1,).
    written
        Receives force (N), deflection (m) and velocity (m/s), each (n_joints, n).
    """
    force, deflection, velocity = written
    decay, start, end, to_x, to_v = dynamics
    (springs, yields), first_element = elements
    count, n_modes = len(driven), len(decay)
    stretch, modes = np.zeros(len(springs)), np.zeros(n_modes, dtype=np.complex128)
    own_x, own_v = _at_once(to_x, end), _at_once(to_v, end)
    (table_x, table_v), spans, first = laws
    state = np.zeros((6, count))
    state[LAST_X] = driven[:, 0]
    for k in range(driven.shape[1]):
        for i in range(count):
            state[FREE_X, i], state[FREE_V, i] = driven[i, k], driven_speed[i, k]
        for r in range(n_modes):
            mode = decay[r] * modes[r]
            for i in range(count):
                mode -= start[i, r] * state[FORCE, i]
            modes[r] = mode
            for i in range(count):
                state[FREE_X, i] += 2.0 * (to_x[i, r] * mode).real
                state[FREE_V, i] += 2.0 * (to_v[i, r] * mode).real
        _balance(state, own_x, own_v, table_x, table_v, spans, first, ramps, k, springs, yields, stretch, first_element)
        for i in range(count):
            x = state[DEFLECTION, i]
            for e in range(first_element[i], first_element[i + 1]):
                stretch[e] = min(max(stretch[e] + x - state[LAST_X, i], -yields[e]), yields[e])
            state[LAST_X, i] = x
            force[i, k], deflection[i, k], velocity[i, k] = state[FORCE, i], x, state[VELOCITY, i]
            for r in range(n_modes):
                modes[r] -= end[i, r] * state[FORCE, i]
