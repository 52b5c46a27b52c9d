"""Compiled time loop of several joints that act on one modal structure at once."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled

from .time_loops import balanced

SWEEPS = 40  # most sweeps over the joints at one instant

SETTLED = 1e-8  # change of a force in a sweep, as a share of it, that ends the sweeps


@compiled
def _at_once(to: Complex, end: Complex) -> Real:
    """Return the motion of each joint (row) that a unit force of each joint (column) takes away at the same instant."""
    own = np.zeros((len(to), len(to)))
    for i in range(len(to)):
        for j in range(len(to)):
            for r in range(to.shape[1]):
                own[i, j] += 2.0 * (to[i, r] * end[j, r]).real
    return own


@compiled
def _shown(to: Complex, modes: Complex) -> float:
    """Return the motion of a joint that the modal coordinates show."""
    total = 0.0
    for r in range(len(modes)):
        total += 2.0 * (to[r] * modes[r]).real
    return total


@compiled
def _others(own: Real, g: Real, joint: int) -> float:
    """Return the motion that the forces of all other joints take away from a joint at once."""
    total = 0.0
    for j in range(len(g)):
        total += own[joint, j] * g[j] if j != joint else 0.0
    return total


@compiled
def _balance(
    state: tuple[Real, Real, Real],
    free: tuple[Real, Real],
    own: tuple[Real, Real],
    laws: tuple[tuple[Real, Real], Real, NDArray[np.int64]],
    ramp: Real,
    elements: tuple[tuple[Real, Real], NDArray[np.int64], Real],
    last_x: Real,
) -> bool:
    """Balance every joint once with the forces of the others held; return whether no force changed."""
    g, x, v = state
    (x_free, v_free), (own_x, own_v) = free, own
    (tables_x, tables_v), spans, first = laws
    (springs, yields), first_element, stretch = elements
    settled = True
    for i in range(len(g)):
        before = g[i]
        x_here, v_here = x_free[i] - _others(own_x, g, i), v_free[i] - _others(own_v, g, i)
        table_x, table_v = tables_x[first[i, 0] : first[i + 1, 0]], tables_v[first[i, 1] : first[i + 1, 1]]
        a, b = first_element[i], first_element[i + 1]
        g[i], x[i], v[i] = balanced(
            (x_here, v_here, before),
            (own_x[i, i], own_v[i, i]),
            (table_x, table_v),
            ((len(table_x) - 1) / (2.0 * spans[i, 0]), (len(table_v) - 1) / (2.0 * spans[i, 1])),
            (spans[i, 0], spans[i, 1]),
            ramp[i],
            (springs[a:b], yields[a:b], stretch[a:b]),
            last_x[i],
        )
        settled &= abs(g[i] - before) <= SETTLED * (abs(g[i]) + 1e-6)
    return settled


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
    own = (_at_once(to_x, end), _at_once(to_v, end))
    g, x, v = np.zeros(count), np.zeros(count), np.zeros(count)
    x_free, v_free = np.zeros(count), np.zeros(count)
    last_x, here = driven[:, 0].copy(), (elements[0], first_element, stretch)
    for k in range(driven.shape[1]):
        for r in range(n_modes):
            modes[r] *= decay[r]
            for j in range(count):
                modes[r] -= start[j, r] * g[j]
        for i in range(count):
            x_free[i] = driven[i, k] + _shown(to_x[i], modes)
            v_free[i] = driven_speed[i, k] + _shown(to_v[i], modes)
        for _ in range(SWEEPS):
            if _balance((g, x, v), (x_free, v_free), own, laws, ramps[:, k], here, last_x):
                break
        for i in range(count):
            for e in range(first_element[i], first_element[i + 1]):
                stretch[e] = min(max(stretch[e] + x[i] - last_x[i], -yields[e]), yields[e])
            last_x[i] = x[i]
            force[i, k], deflection[i, k], velocity[i, k] = g[i], x[i], v[i]
            for r in range(n_modes):
                modes[r] -= end[i, r] * g[i]
