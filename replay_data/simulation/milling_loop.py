"""The regenerative milling loop, compiled: structure, teeth and the surface they leave behind."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from cutting.compilation import compiled
from cutting.one_tooth import engaged_share, specific_forces, tooth_force, wrapped_immersion

from .material import Material
from .modal_integrator import Dynamics, coast, take_force

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


@compiled
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
