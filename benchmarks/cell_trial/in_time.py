"""Cuts and taps in time, from the force equations alone: teeth leave the cut, and each cuts the surface of the last.

The force is held over a step; modes follow it exactly. Force and acceleration are taken at the middle of the step, so
that both belong to the same instant.
"""

from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from numba import njit

from .robot_cell import Complex, Cut, Real, Structure

Function = TypeVar("Function", bound=Callable[..., object])

PLACES = 1440  # angles of a turn at which a tooth's surface is kept


def compiled(function: Function) -> Function:
    """Compile at the first call and keep the machine code on disk."""
    return cast(Function, njit(cache=True, nogil=True)(function))


def mill(
    structure: Structure, cut: Cut, depths: Real, turning: Real, step: float, factors: Real
) -> tuple[Real, Real, Real]:
    """Mill from rest: forces (N), accelerations of the sensor (m/s^2) and motion of the tip (m), each (n, 3).

    Parameters
    ----------
    structure, cut
        Structure and cutter.
    depths : (n,), m
        Axial depth at each step.
    turning : (n,), rad
        Angle of tooth 0 at each step, rising.
    step : s
        Time of a step.
    factors : (n_passes,)
        Factor on the force of each pass of a tooth, in turn.
    """
    modes = structure.poles, structure.tip, structure.sensor, structure.entry
    law = np.array([cut.start, cut.leave, cut.ktc, cut.krc, cut.kac, cut.feed])
    return _mill(*modes, law, cut.teeth, depths, turning, step, factors)


def ring(structure: Structure, force: Real, step: float) -> tuple[Real, Real]:
    """Accelerations of tip and sensor, (n, 3) each, by a force (n, 3) held over each step, at the step's middle."""
    return _ring(structure.poles, structure.tip, structure.sensor, structure.entry, force, step)


@compiled
def _mill(
    poles: Complex,
    tip: Complex,
    sensor: Complex,
    entry: Complex,
    law: Real,
    teeth: int,
    depths: Real,
    turning: Real,
    step: float,
    factors: Real,
) -> tuple[Real, Real, Real]:
    n, modes = len(depths), len(poles)
    whole, half = np.exp(poles * step), np.exp(poles * step / 2)
    filled, half_filled = (whole - 1) / poles, (half - 1) / poles
    state = np.zeros(modes, dtype=np.complex128)
    surface = np.zeros((teeth, PLACES + 1))
    reached, place = np.zeros(teeth), np.full(teeth, -1.0)
    force, last, push = np.zeros(3), np.zeros(3), np.zeros(3)
    forces, acceleration, motion = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    x = np.zeros(3)
    for i in range(n):
        x[:] = 0.0
        for r in range(modes):
            for p in range(3):
                x[p] += 2 * (tip[r, p].real * state[r].real - tip[r, p].imag * state[r].imag)
        last[:] = force
        _cutting_force(x, turning[i], depths[i], law, factors, surface, reached, place, force)
        # the force at the step's middle, from this step and the last
        for p in range(3):
            push[p] = 1.5 * force[p] - 0.5 * last[p]
            forces[i, p] = push[p]
            motion[i, p] = x[p]
        for r in range(modes):
            own = entry[r, 0] * push[0] + entry[r, 1] * push[1] + entry[r, 2] * push[2]
            middle = half[r] * state[r] + half_filled[r] * own
            change = poles[r] * (poles[r] * middle + own)
            for p in range(3):
                acceleration[i, p] += 2 * (sensor[r, p] * change).real
            state[r] = whole[r] * state[r] + filled[r] * own
    return forces, acceleration, motion


@compiled
def _cutting_force(
    x: Real,
    turned: float,
    depth: float,
    law: Real,
    factors: Real,
    surface: Real,
    reached: Real,
    place: Real,
    force: Real,
) -> None:
    """Add up the force of all teeth in the cut, and keep the surface that each leaves at the angles that it passed."""
    start, leave, ktc, krc, kac, feed = law
    teeth = len(surface)
    force[:] = 0.0
    for j in range(teeth):
        angle = turned + 2 * np.pi * j / teeth
        turns = int(np.floor(angle / (2 * np.pi)))
        phi = angle - 2 * np.pi * turns
        if phi < start or phi > leave:
            place[j] = -1.0
            continue
        sine, cosine = np.sin(phi), np.cos(phi)
        exact = phi / (2 * np.pi) * PLACES
        below = int(exact)
        share = exact - below
        before = surface[(j + 1) % teeth]  # of the tooth that passed a pitch ago
        ground = (1 - share) * before[below] + share * before[below + 1] - feed * sine
        out = x[0] * sine + x[1] * cosine
        chip = out - ground
        left = out if chip > 0 else ground
        if chip > 0:
            tangential = factors[(turns * teeth + j) % len(factors)] * ktc * depth * chip
            force[0] -= tangential * (cosine + krc * sine)
            force[1] += tangential * (sine - krc * cosine)
            force[2] -= tangential * kac
        if place[j] < 0:  # the tooth enters
            for k in range(int(start / (2 * np.pi) * PLACES), below + 1):
                surface[j, k] = left
        else:
            for k in range(int(place[j]) + 1, below + 1):
                surface[j, k] = reached[j] + (k - place[j]) / (exact - place[j]) * (left - reached[j])
        surface[j, below + 1] = left  # until the next step passes it
        reached[j], place[j] = left, exact


@compiled
def _ring(poles: Complex, tip: Complex, sensor: Complex, entry: Complex, force: Real, step: float) -> tuple[Real, Real]:
    n, modes = len(force), len(poles)
    whole, half = np.exp(poles * step), np.exp(poles * step / 2)
    filled, half_filled = (whole - 1) / poles, (half - 1) / poles
    state = np.zeros(modes, dtype=np.complex128)
    at_tip, at_sensor = np.zeros((n, 3)), np.zeros((n, 3))
    for i in range(n):
        for r in range(modes):
            own = entry[r, 0] * force[i, 0] + entry[r, 1] * force[i, 1] + entry[r, 2] * force[i, 2]
            middle = half[r] * state[r] + half_filled[r] * own
            change = poles[r] * (poles[r] * middle + own)
            for p in range(3):
                at_tip[i, p] += 2 * (tip[r, p] * change).real
                at_sensor[i, p] += 2 * (sensor[r, p] * change).real
            state[r] = whole[r] * state[r] + filled[r] * own
    return at_tip, at_sensor
