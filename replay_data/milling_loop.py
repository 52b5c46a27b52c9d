"""The regenerative milling loop in the time domain, and whether a cut settles; compiled."""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from millfrf.core import TIP, InputError, Real
from millfrf.core.compilation import CUTTING, SIMULATION, compile_kernels, compiled
from millfrf.cutting import (
    MillingProcess,
    engaged_share,
    refuse_varied,
    specific_forces,
    tooth_force,
    wrapped_immersion,
)
from modal_fit import ModalModel

from .material import Material, material_named
from .modal_integrator import Dynamics, coast, discretise, take_force

MARGIN_STEPS = 4.0
"""Steps outside the immersion over which the surface is still kept, for the interpolation at its edges."""


class Cut(NamedTuple):
    """The cut as the compiled loop wants it: plain numbers, SI."""

    depth: float
    radius: float
    sine_edge: float
    cosine_edge: float
    start: float
    leave: float
    feed: float
    cutting: tuple[float, float, float]
    edge: tuple[float, float, float]
    spread: float
    pore_size: float
    passes_per_pore: int
    seed: np.uint64


class Memory(NamedTuple):
    """What the loop carries from block to block. The surface is a ring over instants (their number a
    power of two, so that places in it are found with a mask), one column a tooth."""

    modal: NDArray[np.float64]
    last_force: NDArray[np.float64]
    angles: NDArray[np.float64]
    surface: NDArray[np.float64]
    counters: NDArray[np.int64]
    """Instants done, and the instant at which the delayed angle was last found."""


def prepare_cut(process: MillingProcess, depth: float, material: Material, seed: int) -> Cut:
    """Gather what :func:`mill` needs; ``seed`` chooses the pores."""
    cutting, edge = specific_forces(process)
    sine_edge = math.sin(process.edge_angle)
    return Cut(
        float(depth),
        0.5 * process.diameter,
        sine_edge,
        math.cos(process.edge_angle),
        float(process.start_angle),
        float(process.exit_angle),
        float(process.feed_per_tooth),
        (float(cutting[0]), float(cutting[1]), float(cutting[2])),
        (float(edge[0]) / sine_edge, float(edge[1]) / sine_edge, float(edge[2]) / sine_edge),
        float(material.spread),
        float(material.pore_size),
        int(material.passes_per_pore),
        np.uint64(seed),
    )


def empty_memory(n_modes: int, teeth: int, instants_of_delay: int) -> Memory:
    """A structure at rest, and room for a surface as old as the longest tooth-passing period."""
    room = 1 << (instants_of_delay + 8).bit_length()
    return Memory(
        np.zeros(2 * n_modes), np.zeros(3), np.zeros(room), np.zeros((room, teeth)), np.zeros(2, dtype=np.int64)
    )


def _example() -> tuple[Any, ...]:
    """Arguments of :func:`mill`, for its compilation ahead of a simulation."""
    line, table = np.zeros(1), np.zeros((1, 1))
    cut = Cut(*(0.0,) * 7, (0.0,) * 3, (0.0,) * 3, 0.0, 0.0, 1, np.uint64(0))
    return line, 1.0, Dynamics(table, table), cut, line, empty_memory(1, 1, 1), table, table


@compiled(example=_example)
def mill(
    angles: NDArray[np.float64],
    step: float,
    dynamics: Dynamics,
    cut: Cut,
    offsets: NDArray[np.float64],
    memory: Memory,
    force: NDArray[np.float64],
    history: NDArray[np.float64],
) -> None:
    """March through spindle ``angles`` (n,); fill ``force`` (n, 3) and modal ``history`` (n, 2 n_modes).

    Every step: predict the displacement with the last force, find the force, correct, find it again (PECE). The force
    at an instant is that of all teeth in the cut on the surface that earlier teeth left at the same angle. ``step`` is
    the angle of one step at the first instant, rad; ``offsets`` (teeth,) how far each tooth runs large, m.
    """
    modes, immediate = dynamics.modes, dynamics.immediate
    modal, last_force = memory.modal, memory.last_force
    ring_angles, surface, counters = memory.angles, memory.surface, memory.counters
    mask = ring_angles.shape[0] - 1
    places = np.zeros((offsets.shape[0], 6))
    coasting, position = np.zeros(3), np.zeros(3)
    for i in range(angles.shape[0]):
        if i > 0:
            step = angles[i] - angles[i - 1]
        coast(modes, last_force, modal, coasting)
        if _place_teeth(angles[i], step, cut, places):
            _find_surface(angles[i], cut, offsets, ring_angles, surface, counters, places)
            _add(coasting, immediate, last_force, position)
            _force_of_all_teeth(angles[i], position, cut, offsets, places, force[i])
            _add(coasting, immediate, force[i], position)
            _force_of_all_teeth(angles[i], position, cut, offsets, places, force[i])
            _add(coasting, immediate, force[i], position)
        else:
            force[i, :] = 0.0
        ring_angles[counters[0] & mask] = angles[i]
        _leave_surface(position, cut, offsets, places, surface[counters[0] & mask])
        counters[0] += 1
        take_force(modes, force[i], last_force, modal, history[i])


@compiled
def _add(
    start: NDArray[np.float64], matrix: NDArray[np.float64], force: NDArray[np.float64], total: NDArray[np.float64]
) -> None:
    for p in range(3):
        total[p] = start[p] + matrix[p, 0] * force[0] + matrix[p, 1] * force[1] + matrix[p, 2] * force[2]


@compiled
def _place_teeth(angle: float, step: float, cut: Cut, places: NDArray[np.float64]) -> bool:
    """Immersion, its sine and cosine, share engaged and middle of each tooth; False when none is near the cut.

    Columns of ``places``: immersion, sine, cosine, share (-1: far from the cut), middle angle, surface below.
    """
    near = False
    teeth = places.shape[0]
    for j in range(teeth):
        immersion = wrapped_immersion(angle + 2.0 * math.pi * j / teeth)
        if immersion < cut.start - MARGIN_STEPS * step or immersion > cut.leave + MARGIN_STEPS * step:
            places[j, 3] = -1.0
            continue
        near = True
        places[j, 0], places[j, 1], places[j, 2] = immersion, math.sin(immersion), math.cos(immersion)
        places[j, 3], places[j, 4] = engaged_share(immersion, step, cut.start, cut.leave)
    return near


@compiled
def _find_surface(
    angle: float,
    cut: Cut,
    offsets: NDArray[np.float64],
    angles: NDArray[np.float64],
    surface: NDArray[np.float64],
    counters: NDArray[np.int64],
    places: NDArray[np.float64],
) -> None:
    """Surface in front of each tooth: what the tooth ahead left when the spindle stood one pitch earlier.

    The earlier instant is sought on the angle axis, so that it is right while the speed changes; between instants the
    surface is a cubic through four of them. Before the first pitch (angles count from 0) it is that of a rigid tool.
    """
    teeth, mask = offsets.shape[0], angles.shape[0] - 1
    sought = angle - 2.0 * math.pi / teeth
    if sought <= 0.0:
        for j in range(teeth):
            places[j, 5] = offsets[(j + 1) % teeth] * cut.sine_edge
        return
    found = max(counters[1], counters[0] - mask)
    while found + 1 < counters[0] and angles[(found + 1) & mask] <= sought:
        found += 1
    counters[1] = found
    row = (max(found - 1, 0) & mask, found & mask, (found + 1) & mask, (found + 2) & mask)
    u = (sought - angles[row[1]]) / (angles[row[2]] - angles[row[1]])
    weight = (
        -u * (u - 1.0) * (u - 2.0) / 6.0,
        (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
        -(u + 1.0) * u * (u - 2.0) / 2.0,
        (u + 1.0) * u * (u - 1.0) / 6.0,
    )
    for j in range(teeth):
        ahead = (j + 1) % teeth
        places[j, 5] = (
            weight[0] * surface[row[0], ahead]
            + weight[1] * surface[row[1], ahead]
            + weight[2] * surface[row[2], ahead]
            + weight[3] * surface[row[3], ahead]
        )


@compiled
def _force_of_all_teeth(
    angle: float,
    position: NDArray[np.float64],
    cut: Cut,
    offsets: NDArray[np.float64],
    places: NDArray[np.float64],
    force: NDArray[np.float64],
) -> None:
    teeth = offsets.shape[0]
    force[:] = 0.0
    for j in range(teeth):
        if places[j, 3] <= 0.0:
            continue
        sine, cosine, middle = places[j, 1], places[j, 2], places[j, 4]
        outward = _outward(sine, cosine, position, cut) + offsets[j] * cut.sine_edge
        if places[j, 3] < 1.0:
            sine, cosine = math.sin(middle), math.cos(middle)
        thickness = outward - places[j, 5] + cut.feed * sine * cut.sine_edge
        if thickness <= 0.0:
            continue
        width = places[j, 3] * cut.depth
        tangential = width * (cut.cutting[0] * thickness + cut.edge[0])
        radial = width * (cut.cutting[1] * thickness + cut.edge[1])
        axial = width * (cut.cutting[2] * thickness + cut.edge[2])
        if cut.spread > 0.0:
            turns = math.floor((angle + 2.0 * math.pi * j / teeth - places[j, 0]) / (2.0 * math.pi) + 0.5)
            layer = (turns * teeth - j) // cut.passes_per_pore
            tangential *= _factor(middle, layer, 0, cut)
            radial *= _factor(middle, layer, 1, cut)
            axial *= _factor(middle, layer, 2, cut)
        x, y, z = tooth_force(sine, cosine, cut.sine_edge, cut.cosine_edge, tangential, radial, axial)
        force[0] += x
        force[1] += y
        force[2] += z


@compiled
def _outward(sine: float, cosine: float, position: NDArray[np.float64], cut: Cut) -> float:
    """The tip's displacement along the direction in which chip thickness is counted, m."""
    return float((position[0] * sine + position[1] * cosine) * cut.sine_edge - position[2] * cut.cosine_edge)


@compiled
def _leave_surface(
    position: NDArray[np.float64],
    cut: Cut,
    offsets: NDArray[np.float64],
    places: NDArray[np.float64],
    surface: NDArray[np.float64],
) -> None:
    """Note the surface behind each tooth: its own edge or, where that cut nothing, the old one, a feed nearer."""
    for j in range(offsets.shape[0]):
        if places[j, 3] < 0.0:
            surface[j] = 0.0
            continue
        edge = _outward(places[j, 1], places[j, 2], position, cut) + offsets[j] * cut.sine_edge
        if cut.start <= places[j, 0] <= cut.leave:
            edge = max(edge, places[j, 5] - cut.feed * places[j, 1] * cut.sine_edge)
        surface[j] = edge


@compiled
def _factor(immersion: float, layer: int, direction: int, cut: Cut) -> float:
    """Random factor of the material's cell at this place: the same whenever and in whatever block it is asked for."""
    shift = _uniform(cut.seed, layer, -1, 3)
    cell = math.floor(immersion * cut.radius / cut.pore_size + shift)
    return 1.0 - cut.spread - cut.spread * math.log(_uniform(cut.seed, layer, cell, direction))


@compiled
def _uniform(seed: np.uint64, layer: int, cell: int, direction: int) -> float:
    """Uniform in (0, 1], a hash of its arguments (SplitMix64 finaliser: Steele, Lea & Flood, OOPSLA 2014)."""
    z = np.uint64(seed)
    for part in (layer, cell, direction):
        z = (z ^ np.uint64(part)) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 1.0) * 2.0**-53


SETTLED = 1e-3
"""Share of the largest deviation to which it must have fallen."""

STEPS = (128, 24.0)
"""Least steps a tooth, and least steps a period of the highest mode."""

LONGEST = (4000, 4_000_000)
"""Most turns, and most steps, before the question is left open."""


@dataclass(frozen=True)
class Settling:
    """The course of a deviation from a motion that repeats with every tooth.

    Parameters
    ----------
    verdict
        ``decays``, ``grows``, or ``open`` where neither was clear after the longest run.
    turns
        Revolutions of the spindle that were simulated.
    share
        The last tooth's deviation over the largest of the first teeth's.
    """

    verdict: str
    turns: float
    share: float


def settle(structure: ModalModel, process: MillingProcess, depth: float, spindle_speed: float) -> Settling:
    """Start the cut from rest and watch ``max |x(t) - x(t - tau)|`` over each tooth period tau.

    Runout is left out (with it teeth differ for ever). Entering the cut is the disturbance. A stable cut forgets it. A
    cut that doubles its period or turns (Hopf) does not, whether it grows on or teeth that leave the cut hold it.

    Parameters
    ----------
    structure
        Receptance with responses and excitations ``TCP:+X +Y +Z``; of residuals, a flexibility alone.
    process
        Cutter, engagement, feed.
    depth, spindle_speed
        m and rad/s.

    Raises
    ------
    InputError
        A structure or a process that the simulated cell does not take, or no feed per tooth.
    """
    refuse_varied(process, "the simulated cut", "give straight edges at equal pitch without process damping")
    if not process.feed_per_tooth > 0:
        raise InputError("a simulated cut needs a feed; give feed_per_tooth_m in the cutting file")
    passing = 2 * math.pi / (process.teeth * spindle_speed)
    highest = float(np.abs(structure.poles).max()) / (2 * math.pi)
    steps = max(STEPS[0], math.ceil(STEPS[1] * highest * passing))
    compile_kernels(*CUTTING, *SIMULATION)
    dynamics = discretise(replace(structure, residuals=None), passing / steps)
    if structure.residuals is not None:
        dynamics = dynamics._replace(immediate=dynamics.immediate + structure.residuals.upper)
    memory = empty_memory(len(structure.poles), process.teeth, steps)
    tip = [structure.responses.index(label) for label in TIP]
    output = 2 * np.stack([structure.right.real, -structure.right.imag], axis=1)[:, :, tip].reshape(-1, len(tip))
    run = _Run(process, depth, steps, dynamics, memory, output)
    return _watched(run, process.teeth, min(LONGEST[0] * process.teeth, LONGEST[1] // steps))


class _Run:
    """The loop, tooth by tooth."""

    def __init__(
        self, process: MillingProcess, depth: float, steps: int, dynamics: Dynamics, memory: Memory, output: Real
    ) -> None:
        self._cut = prepare_cut(process, depth, material_named("homogeneous"), 0)
        self._pitch, self._steps = 2 * math.pi / process.teeth, steps
        self._dynamics, self._memory, self._output = dynamics, memory, output
        self._before = np.zeros((steps, 3))

    def deviations(self, teeth: int) -> Real:
        """Largest deviation from the tooth before, of the next ``teeth`` tooth periods, m."""
        count, done = teeth * self._steps, int(self._memory.counters[0])
        step = self._pitch / self._steps
        angles = step * np.arange(done, done + count, dtype=float)
        history, force = np.empty((count, len(self._memory.modal))), np.empty((count, 3))
        offsets = np.zeros(round(2 * math.pi / self._pitch))
        mill(angles, step, self._dynamics, self._cut, offsets, self._memory, force, history)
        motion = np.concatenate([self._before, history @ self._output])
        self._before = motion[-self._steps :]
        away = np.linalg.norm(motion[self._steps :] - motion[: -self._steps], axis=1)
        return np.asarray(away.reshape(teeth, self._steps).max(axis=1))


def _watched(run: _Run, teeth: int, longest: int) -> Settling:
    """Go on until the deviation has fallen enough, has outgrown the first by far, or no longer falls."""
    block = 10 * teeth
    seen = run.deviations(block)
    first = float(seen.max())
    while len(seen) < longest:
        seen = np.concatenate([seen, run.deviations(block)])
        share = float(seen[-block:].max()) / first
        if share < SETTLED:
            return Settling("decays", len(seen) / teeth, share)
        if len(seen) >= 40 * block and _no_longer_falls(seen):
            return Settling("grows", len(seen) / teeth, share)
    return Settling("open", len(seen) / teeth, float(seen[-block:].max()) / first)


def _no_longer_falls(seen: Real) -> bool:
    """Whether the last quarter's peak is not below that of the quarter before."""
    quarter = len(seen) // 4
    return bool(seen[-quarter:].max() >= seen[-2 * quarter : -quarter].max())
