"""Passes of sliced edges over the surface in the time domain, with loss of contact; compiled."""

import math
from typing import Any, NamedTuple

import numpy as np

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled, inner_loop
from millfrf.cutting import MillingProcess, edge_slices, engaged_share, equivalent_chip, specific_forces, tooth_force

LONGEST_LAG = 0.05  # rad; along a disc the middle stands for all of its edge


class EdgeDiscs(NamedTuple):
    """Thin discs of the cutter from the tip upwards, each with one edge per tooth."""

    heights: Real  # (n_discs,), m, of their middles
    lags: Real  # (teeth, n_discs), rad: angle by which the edge of each tooth lags its tip
    starts: Real  # (n_discs,), rad: immersion angle at which an edge enters the cut
    exits: Real  # (n_discs,), rad
    sines: Real  # (n_discs,): of the edge angle
    cosines: Real  # (n_discs,)
    widths: Real  # (n_discs,), m, of the edge
    offsets: Real  # (teeth, n_discs), m: radial offset of each edge by runout and serration


class CutInTime(NamedTuple):
    """What the force in time depends on besides its discs."""

    aheads: Real  # (teeth,), rad: by which each tooth is ahead of tooth 0
    cutting: Real  # (3,), Pa: tangential, radial and axial
    edge: Real  # (3,), N/m, per width of the edge
    feed: float  # m per revolution
    damping: float  # N s/m^2: flank force per width of the edge and speed into the surface, times the cutting speed
    radius: float  # m
    exponents: Real  # (3,): of the chip thickness
    reference: float  # m: chip thickness at which the coefficients hold
    edge_radius: float  # m


class Structure(NamedTuple):
    """Modes at the tool tip."""

    poles: Complex  # (n_modes,), rad/s
    right: Complex  # (n_modes, 3)
    left: Complex  # (n_modes, 3)
    upper: Real  # (3, 3), m/N: residual flexibility


class Course(NamedTuple):
    """Result of the passes at every instant."""

    motion: Real  # (n_instants, 3), m
    force: Real  # (n_instants, 3), N
    chip: Real  # (n_instants,), m: thickest chip of all edges
    walls: Real  # (n_turns, 2, n_discs), m: outermost pass of a turn over the walls at immersion 0 and 180 deg


def edge_discs(process: MillingProcess, depth: float) -> EdgeDiscs:
    """Divide the edges up to a depth (m) into discs whose edges turn by at most 0.05 rad."""
    slices = edge_slices(process, depth)
    longest = np.abs(np.diff(slices.lags, axis=2)).max(initial=0.0)
    count = max(1, math.ceil(longest / LONGEST_LAG))
    share = (np.arange(count) + 0.5) / count

    def middles(ends: Real) -> Real:
        values = ends[..., :1] + share * (ends[..., 1:] - ends[..., :1])
        return np.ascontiguousarray(values.reshape(*ends.shape[:-2], -1))

    angles = middles(slices.edge_angles)
    widths = np.repeat(slices.widths / count, count)
    rises = widths * (np.sin(angles) if process.profile else 1.0)
    heights = np.cumsum(rises) - rises / 2
    return EdgeDiscs(
        heights, middles(slices.lags), middles(slices.starts), middles(slices.exits), np.sin(angles), np.cos(angles),
        widths, middles(slices.offsets) + _small_runout(process),
    )  # fmt: skip


def _small_runout(process: MillingProcess) -> Real:
    """Return the offsets of runout that slices leave out because no tooth misses most of its cut, (teeth, 1), m."""
    kept = 0.0 if process.runout_decides else process.runout
    return kept * np.cos(2 * np.pi * np.arange(process.teeth) / process.teeth)[:, None]


def cut_in_time(process: MillingProcess) -> CutInTime:
    """Collect what the force depends on; the edge angle of a plain cut counts the depth as the width of the edge."""
    cutting, edge = specific_forces(process)
    edge = edge / (1.0 if process.profile else math.sin(process.edge_angle))
    feed = process.feed_per_tooth * process.teeth
    law = process.chip_law
    return CutInTime(
        np.array(process.tooth_angles), cutting, edge, feed, process.process_damping, process.diameter / 2,
        np.array(law.exponents), law.reference, law.edge_radius,
    )  # fmt: skip


def _example() -> tuple[Any, ...]:
    row, table, square = np.zeros(2), np.zeros((2, 2)), np.zeros((3, 3))
    discs = EdgeDiscs(row, table, row, row, row, row, row, table)
    modes = np.zeros((1, 3), dtype=complex)
    structure = Structure(np.zeros(1, dtype=complex), modes, modes, square)
    cut = CutInTime(row, np.zeros(3), np.zeros(3), 0.0, 0.0, 1.0, np.zeros(3), 1.0, 0.0)
    return row, 1, discs, cut, structure, Course(table, table, row, np.zeros((1, 2, 2)))


@compiled
def _hold_weights(turned: complex) -> tuple[complex, complex, complex]:
    """Return ``exp(z)`` and the weights of an old and a new input that is linear over a step, for z = pole times step.

    The weights are ``phi_1 - phi_2`` and ``phi_2`` with ``phi_1 = (e^z - 1) / z`` and ``phi_2 = (e^z - 1 - z) / z^2``.
    """
    decay = np.exp(turned)
    if abs(turned) < 1e-3:
        second = 0.5 + turned / 6.0 + turned * turned / 24.0
        return decay, 1.0 + turned * second - second, second
    second = (decay - 1.0 - turned) / (turned * turned)
    return decay, (decay - 1.0) / turned - second, second


@compiled
def _moved(states: Complex, structure: Structure, force: Real, motion: Real, rate: Real) -> None:
    """Write the tip's motion (m) and velocity (m/s) of modal states and of the residual flexibility."""
    for axis in range(3):
        motion[axis], rate[axis] = 0.0, 0.0
        for r in range(len(states)):
            motion[axis] += 2.0 * (structure.right[r, axis] * states[r]).real
            rate[axis] += 2.0 * (structure.right[r, axis] * structure.poles[r] * states[r]).real
        for other in range(3):
            motion[axis] += structure.upper[axis, other] * force[other]


@compiled
def _level(motion: Real, fed: float, offset: float, phi: float, sine: float, cosine: float) -> float:
    """Return how far out an edge stands at an immersion, m, in the direction in which chips are counted."""
    outward = (motion[0] + fed) * math.sin(phi) + motion[1] * math.cos(phi) + offset
    return float(outward * sine - motion[2] * cosine)


@compiled
def _surface(surface: Real, disc: int, place: float) -> float:
    """Return the deepest surface that a tooth left in its last pass, m, at a place between two bins."""
    below, deepest = min(int(place), surface.shape[2] - 2), -np.inf
    for tooth in range(surface.shape[0]):
        first = surface[tooth, disc, below]
        deepest = max(deepest, first + (place - below) * (surface[tooth, disc, below + 1] - first))
    return deepest


@compiled
def _empty_surface(discs: EdgeDiscs, cut: CutInTime, bins: int) -> Real:
    """Return the surface (teeth, n_discs, n_bins), m, that a tooth left without vibration before the cut began."""
    surface = np.empty((len(cut.aheads), len(discs.widths), bins))
    for disc in range(len(discs.widths)):
        for place in range(bins):
            sine = math.sin(place * math.pi / (bins - 1))
            surface[:, disc, place] = -cut.feed / len(cut.aheads) * sine * discs.sines[disc]
    return surface


@inner_loop
def _pressed(cut: CutInTime, axis: int, chip: float) -> float:
    """Return the force of a chip (m) and of its edge per width, N/m."""
    equivalent = equivalent_chip(chip, cut.exponents[axis], cut.reference, cut.edge_radius)
    return float(cut.cutting[axis] * equivalent + cut.edge[axis])


@compiled
def _add_force(
    angle: float,
    step: float,
    speed: float,
    discs: EdgeDiscs,
    cut: CutInTime,
    motion: Real,
    rate: Real,
    surface: Real,
    force: Real,
) -> float:
    """Add the force of all edges at a spindle angle (rad) to ``force``; return the thickest chip (m)."""
    thickest = 0.0
    for tooth in range(len(cut.aheads)):
        for disc in range(len(discs.widths)):
            phi = (angle + cut.aheads[tooth] - discs.lags[tooth, disc] + 0.5 * math.pi) % (2 * math.pi) - 0.5 * math.pi
            share, middle = engaged_share(phi, step, discs.starts[disc], discs.exits[disc])
            if share == 0.0:
                continue
            sine, cosine = discs.sines[disc], discs.cosines[disc]
            at = min(max(phi, middle, 0.0), math.pi)  # not behind the edge, where this pass has left its own surface
            left = _surface(surface, disc, at / step)
            fed = cut.feed * (angle + at - phi) / (2 * math.pi)
            chip = _level(motion, fed, discs.offsets[tooth, disc], at, sine, cosine) - left
            if chip <= 0.0:
                continue
            thickest = max(thickest, chip)
            width = share * discs.widths[disc]
            s, c = math.sin(at), math.cos(at)
            push = tooth_force(
                s, c, sine, cosine,
                width * _pressed(cut, 0, chip),
                width * _pressed(cut, 1, chip),
                width * _pressed(cut, 2, chip),
            )  # fmt: skip
            into = (rate[0] * s + rate[1] * c) * sine - rate[2] * cosine
            flank = width * cut.damping / (speed * cut.radius) * into
            force[0] += push[0] - flank * s * sine
            force[1] += push[1] - flank * c * sine
            force[2] += push[2] + flank * cosine
    return thickest


@compiled
def _leave_surface(
    angle: float,
    step: float,
    discs: EdgeDiscs,
    cut: CutInTime,
    before: Real,
    after: Real,
    surface: Real,
    walls: Real,
) -> None:
    """Note where edges passed during the last step, and the outermost passes over the walls."""
    bins, between = surface.shape[2], np.empty(3)
    for tooth in range(len(cut.aheads)):
        for disc in range(len(discs.widths)):
            phi = (angle + cut.aheads[tooth] - discs.lags[tooth, disc]) % (2 * math.pi)
            place = phi / step
            if place > 2 * (bins - 1) - 1e-6:  # rounding must not leave out a place where edges pass exactly over it
                place -= 2 * (bins - 1)
            crossed = int(place + 1e-6)
            behind = place - crossed
            at = crossed * step
            if crossed >= bins or at < discs.starts[disc] - step or at > discs.exits[disc] + step:
                continue
            for axis in range(3):
                between[axis] = after[axis] - behind * (after[axis] - before[axis])
            fed = cut.feed * (angle - behind * step) / (2 * math.pi)
            offset = discs.offsets[tooth, disc]
            level = _level(between, fed, offset, at, discs.sines[disc], discs.cosines[disc])
            surface[tooth, disc, crossed] = level
            if crossed == 0 or crossed == bins - 1:
                wall = 0 if crossed == 0 else 1
                outward = (1.0 - 2.0 * wall) * between[1] + offset
                walls[wall, disc] = max(walls[wall, disc], outward)


@compiled(example=_example)
def pass_edges(
    durations: Real, steps: int, discs: EdgeDiscs, cut: CutInTime, structure: Structure, course: Course
) -> None:
    """Simulate passes of the edges over a surface that earlier passes left without vibration.

    The spindle turns by ``2 pi / steps`` in each instant, so that an edge passes one place of the surface per instant.
    The surface at a place is the deepest that a pass of the last turn left there, at ``rho(phi) = ((x + fed) sin phi +
    y cos phi + offset) sin gamma - z cos gamma``; the chip is the edge's present rho less that of the surface, and
    there is no force while it is negative. Older passes are left out: the feed has moved the cutter on, and near the
    walls, where it uncovers no new material at an immersion, they would count for ever. Modal states are exact for a
    force that is linear over a step.

    Parameters
    ----------
    durations : (n_instants,), s
        Duration of each step; constant unless the spindle speed varies.
    steps
        Steps in a turn, an even number.
    discs, cut, structure
        Cutter, cut and modes.
    course
        Receives motion, force, chip, and the outermost passes over the walls.
    """
    step, count = 2 * math.pi / steps, len(structure.poles)
    surface = _empty_surface(discs, cut, steps // 2 + 1)
    states, ahead = np.zeros(count, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    weights, last = np.zeros((3, count), dtype=np.complex128), 0.0
    force, old_force, guess = np.zeros(3), np.zeros(3), np.zeros(3)
    motion, old_motion, rate = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(len(durations)):
        duration = durations[i]
        if duration != last:
            for r in range(count):
                weights[0, r], weights[1, r], weights[2, r] = _hold_weights(structure.poles[r] * duration)
            last = duration
        for r in range(count):
            pushed = 0j
            for axis in range(3):
                pushed += structure.left[r, axis] * old_force[axis]
            ahead[r] = weights[0, r] * states[r] + duration * weights[1, r] * pushed
            states[r] = ahead[r] + duration * weights[2, r] * pushed
        _moved(states, structure, old_force, guess, rate)
        force[:] = 0.0
        angle = (i + 1) * step
        course.chip[i] = _add_force(angle, step, step / duration, discs, cut, guess, rate, surface, force)
        for r in range(count):
            pushed = 0j
            for axis in range(3):
                pushed += structure.left[r, axis] * force[axis]
            states[r] = ahead[r] + duration * weights[2, r] * pushed
        _moved(states, structure, force, motion, rate)
        _leave_surface(angle, step, discs, cut, old_motion, motion, surface, course.walls[i // steps])
        for axis in range(3):
            course.motion[i, axis], course.force[i, axis] = motion[axis], force[axis]
            old_motion[axis], old_force[axis] = motion[axis], force[axis]
