"""The regenerative milling loop in the time domain, and whether a cut settles; compiled."""

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from millfrf.core import TIP, Index, InputError, Real
from millfrf.core.compilation import CUTTING, SIMULATION, compile_kernels, compiled
from millfrf.cutting import (
    MillingProcess,
    engaged_share,
    equivalent_chip,
    refuse_varied,
    specific_forces,
    tooth_force,
    wrapped_immersion,
)
from modal_fit import ModalModel

from .modal_integrator import Dynamics, add_new_force, discretise, step_without_new_force
from .settings import SETTINGS

_MARGIN_STEPS = 4.0  # steps outside the immersion over which the surface is stored, to interpolate at its edges


@dataclass(frozen=True)
class Material:
    """Random variation of the specific cutting forces along the cut.

    The material along the path of each tooth is divided into cells as long as a pore. In each cell tangential, radial
    and axial force are multiplied by independent random factors ``(1 - spread) + spread * e`` with e exponential of
    mean 1: never negative, mean 1, standard deviation ``spread``. The mean force is the same as in homogeneous
    material; the three forces become linearly independent at all frequencies, so that one cut gives the whole FRF
    matrix (Mohammadi & Ahmadi, "Milling of porous material"). The exponential distribution is assumed.

    >>> Material("foam", spread=1.5)
    Traceback (most recent call last):
    millfrf.core.errors.InputError: spread = 1.5 of material foam must lie in 0 ... 1
    """

    name: str
    spread: float = 0.0  # standard deviation of the specific forces over their mean, 0 (homogeneous) to 1
    pore_size: float = 1e-3  # m: length of a cell along the tooth path
    passes_per_pore: int = 1  # number of tooth passes through the same cells: pore size over feed per tooth

    def __post_init__(self) -> None:
        if not 0 <= self.spread <= 1:
            raise InputError(f"spread = {self.spread!r} of material {self.name} must lie in 0 ... 1")
        if not self.pore_size > 0:
            raise InputError(f"pore size {self.pore_size!r} m of material {self.name} must be positive")
        if not (isinstance(self.passes_per_pore, int) and self.passes_per_pore >= 1):
            raise InputError(
                f"passes per pore {self.passes_per_pore!r} of material {self.name} must be 1 or more, whole"
            )


_MATERIALS = {
    "homogeneous": Material("homogeneous"),
    "porous": Material("porous", spread=0.9, pore_size=1.5e-3),  # a coarse metal foam
}


def material_named(material: str | Material) -> Material:
    """Return the material of a name, ``homogeneous`` or ``porous``; a ``Material`` is returned as it is."""
    if isinstance(material, Material):
        return material
    if material not in _MATERIALS:
        raise InputError(f"unknown material {material!r}; use {' or '.join(_MATERIALS)}, or a Material")
    return _MATERIALS[material]


class Cut(NamedTuple):
    """Parameters of the cut for the compiled loop, SI."""

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
    exponents: tuple[float, float, float]
    reference: float
    edge_radius: float


class Memory(NamedTuple):
    """State of the milling loop that is kept from block to block.

    Angles and surface are ring buffers over the simulated instants. Their length is a power of two, so that a bit mask
    converts the number of an instant to its place.
    """

    modal: Real  # (2 n_modes,)
    last_force: Real  # (3,), N
    angles: Real  # (n_ring,), rad
    surface: Real  # (n_ring, teeth), m
    counters: Index  # instants simulated, and the instant at which the delayed angle was last found


def prepare_cut(process: MillingProcess, depth: float, material: Material, seed: int) -> Cut:
    """Collect the parameters of :func:`mill`; ``seed`` determines the pores."""
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
        process.chip_law.exponents,
        process.chip_law.reference,
        process.chip_law.edge_radius,
    )


def empty_memory(n_modes: int, teeth: int, instants_of_delay: int) -> Memory:
    """Return the memory of a structure at rest, with room for the surface of the longest tooth-passing period."""
    n_ring = 1 << (instants_of_delay + 8).bit_length()
    return Memory(
        np.zeros(2 * n_modes), np.zeros(3), np.zeros(n_ring), np.zeros((n_ring, teeth)), np.zeros(2, dtype=np.int64)
    )


def _example() -> tuple[Any, ...]:
    """Return arguments of :func:`mill`, with which it is compiled ahead of a simulation."""
    line, table = np.zeros(1), np.zeros((1, 1))
    cut = Cut(*(0.0,) * 7, (0.0,) * 3, (0.0,) * 3, 0.0, 0.0, 1, np.uint64(0), (0.0,) * 3, 1.0, 0.0)
    return line, 1.0, Dynamics(table, table), cut, line, empty_memory(1, 1, 1), table, table


@compiled(example=_example)
def mill(
    angles: Real,
    step: float,
    dynamics: Dynamics,
    cut: Cut,
    offsets: Real,
    memory: Memory,
    force: Real,
    history: Real,
) -> None:
    """Integrate the cut over spindle ``angles`` (n,), rad; fill ``force`` (n, 3) and ``history`` (n, 2 n_modes).

    Every step predicts the displacement with the last force, evaluates the force, corrects the displacement, and
    evaluates the force again (PECE). The force at an instant is the sum over all teeth in the cut; each cuts the
    surface that earlier teeth left at the same angle. ``step`` is the angle of the step to the first instant, rad;
    ``offsets`` (teeth,) is the radial runout of each tooth, m.
    """
    modes, immediate = dynamics.modes, dynamics.immediate
    modal, last_force = memory.modal, memory.last_force
    ring_angles, surface, counters = memory.angles, memory.surface, memory.counters
    mask = ring_angles.shape[0] - 1
    places = np.zeros((offsets.shape[0], 6))
    free_position, position = np.zeros(3), np.zeros(3)
    for i in range(angles.shape[0]):
        if i > 0:
            step = angles[i] - angles[i - 1]
        step_without_new_force(modes, last_force, modal, free_position)
        if _place_teeth(angles[i], step, cut, places):
            _look_up_surface(angles[i], cut, offsets, ring_angles, surface, counters, places)
            _add(free_position, immediate, last_force, position)
            _total_force(angles[i], position, cut, offsets, places, force[i])
            _add(free_position, immediate, force[i], position)
            _total_force(angles[i], position, cut, offsets, places, force[i])
            _add(free_position, immediate, force[i], position)
        else:
            force[i, :] = 0.0
        ring_angles[counters[0] & mask] = angles[i]
        _store_surface(position, cut, offsets, places, surface[counters[0] & mask])
        counters[0] += 1
        add_new_force(modes, force[i], last_force, modal, history[i])


@compiled
def _add(start: Real, matrix: Real, force: Real, total: Real) -> None:
    for p in range(3):
        total[p] = start[p] + matrix[p, 0] * force[0] + matrix[p, 1] * force[1] + matrix[p, 2] * force[2]


@compiled
def _place_teeth(angle: float, step: float, cut: Cut, places: Real) -> bool:
    """Fill the position of each tooth; return False when no tooth is near the cut.

    Columns of ``places``: immersion angle, its sine and cosine, share of the step in the cut (-1: far from the cut),
    middle angle of that share, surface in front of the tooth.
    """
    near_cut = False
    teeth = places.shape[0]
    for j in range(teeth):
        immersion = wrapped_immersion(angle + 2.0 * math.pi * j / teeth)
        if immersion < cut.start - _MARGIN_STEPS * step or immersion > cut.leave + _MARGIN_STEPS * step:
            places[j, 3] = -1.0
            continue
        near_cut = True
        places[j, 0], places[j, 1], places[j, 2] = immersion, math.sin(immersion), math.cos(immersion)
        places[j, 3], places[j, 4] = engaged_share(immersion, step, cut.start, cut.leave)
    return near_cut


@compiled
def _look_up_surface(
    angle: float, cut: Cut, offsets: Real, angles: Real, surface: Real, counters: Index, places: Real
) -> None:
    """Find the surface in front of each tooth, which the tooth ahead left one pitch earlier.

    The earlier instant is searched on the angle axis, so that it is correct while the speed changes. Between instants
    the surface is interpolated by a cubic through four of them. During the first pitch (angles start at 0) it is the
    surface that a rigid tool leaves.
    """
    teeth, mask = offsets.shape[0], angles.shape[0] - 1
    delayed_angle = angle - 2.0 * math.pi / teeth
    if delayed_angle <= 0.0:
        for j in range(teeth):
            places[j, 5] = offsets[(j + 1) % teeth] * cut.sine_edge
        return
    instant = max(counters[1], counters[0] - mask)
    while instant + 1 < counters[0] and angles[(instant + 1) & mask] <= delayed_angle:
        instant += 1
    counters[1] = instant
    row = (max(instant - 1, 0) & mask, instant & mask, (instant + 1) & mask, (instant + 2) & mask)
    u = (delayed_angle - angles[row[1]]) / (angles[row[2]] - angles[row[1]])
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
def _total_force(angle: float, position: Real, cut: Cut, offsets: Real, places: Real, force: Real) -> None:
    teeth = offsets.shape[0]
    force[:] = 0.0
    for j in range(teeth):
        if places[j, 3] <= 0.0:
            continue
        sine, cosine, middle = places[j, 1], places[j, 2], places[j, 4]
        outward = _radial(sine, cosine, position, cut) + offsets[j] * cut.sine_edge
        if places[j, 3] < 1.0:  # the tooth enters or leaves within the step: its force acts in the middle of its share
            sine, cosine = math.sin(middle), math.cos(middle)
        thickness = outward - places[j, 5] + cut.feed * sine * cut.sine_edge
        if thickness <= 0.0:
            continue
        width = places[j, 3] * cut.depth
        tangential = width * _pressed(cut, 0, thickness)
        radial = width * _pressed(cut, 1, thickness)
        axial = width * _pressed(cut, 2, thickness)
        if cut.spread > 0.0:
            # the layer numbers the tooth passes; pores are as deep as several of them
            turns = math.floor((angle + 2.0 * math.pi * j / teeth - places[j, 0]) / (2.0 * math.pi) + 0.5)
            layer = (turns * teeth - j) // cut.passes_per_pore
            tangential *= _pore_factor(middle, layer, 0, cut)
            radial *= _pore_factor(middle, layer, 1, cut)
            axial *= _pore_factor(middle, layer, 2, cut)
        x, y, z = tooth_force(sine, cosine, cut.sine_edge, cut.cosine_edge, tangential, radial, axial)
        force[0] += x
        force[1] += y
        force[2] += z


@compiled
def _pressed(cut: Cut, axis: int, thickness: float) -> float:
    """Return the force of a chip (m) and of its edge per depth, N/m."""
    equivalent = equivalent_chip(thickness, cut.exponents[axis], cut.reference, cut.edge_radius)
    return float(cut.cutting[axis] * equivalent + cut.edge[axis])


@compiled
def _radial(sine: float, cosine: float, position: Real, cut: Cut) -> float:
    """Return the tip's displacement along the direction of the chip thickness, m."""
    return float((position[0] * sine + position[1] * cosine) * cut.sine_edge - position[2] * cut.cosine_edge)


@compiled
def _store_surface(position: Real, cut: Cut, offsets: Real, places: Real, surface: Real) -> None:
    """Store the surface behind each tooth: the tooth's edge or, if it cut nothing, the old surface minus the feed."""
    for j in range(offsets.shape[0]):
        if places[j, 3] < 0.0:
            surface[j] = 0.0
            continue
        edge = _radial(places[j, 1], places[j, 2], position, cut) + offsets[j] * cut.sine_edge
        if cut.start <= places[j, 0] <= cut.leave:
            edge = max(edge, places[j, 5] - cut.feed * places[j, 1] * cut.sine_edge)
        surface[j] = edge


@compiled
def _pore_factor(immersion: float, layer: int, direction: int, cut: Cut) -> float:
    """Return the random factor of the material's cell at an immersion angle, independent of blocks and steps."""
    shift = _uniform(cut.seed, layer, -1, 3)
    cell = math.floor(immersion * cut.radius / cut.pore_size + shift)
    return 1.0 - cut.spread - cut.spread * math.log(_uniform(cut.seed, layer, cell, direction))


@compiled
def _uniform(seed: np.uint64, layer: int, cell: int, direction: int) -> float:
    """Return a number uniform in (0, 1], a hash of the arguments (SplitMix64: Steele, Lea & Flood, OOPSLA 2014)."""
    z = np.uint64(seed)
    for number in (layer, cell, direction):
        z = (z ^ np.uint64(number)) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 1.0) * 2.0**-53


@dataclass(frozen=True)
class Settling:
    """Result of :func:`settle`: whether the motion of the tool settles to one that repeats with every tooth.

    Parameters
    ----------
    verdict
        ``decays``, ``grows``, or ``open`` where the longest run showed neither.
    turns
        Revolutions of the spindle that were simulated.
    share
        Largest deviation of the last teeth over the largest deviation of the first teeth.
    """

    verdict: str
    turns: float
    share: float


def settle(structure: ModalModel, process: MillingProcess, depth: float, spindle_speed: float) -> Settling:
    """Simulate a cut from rest and find whether the deviation from one tooth period to the next decays.

    The deviation is ``max |x(t) - x(t - tau)|`` over each tooth period tau; the entry into the cut disturbs the motion.
    In a stable cut the deviation decays. After a period doubling or a Hopf bifurcation it does not, whether it grows
    without bound or is limited by teeth that leave the cut. Runout is left out, because with it teeth always differ.

    Parameters
    ----------
    structure
        Receptance with responses and excitations ``TCP:+X +Y +Z``; of residuals, only a flexibility.
    process
        Cutter, engagement, feed.
    depth, spindle_speed
        Axial depth (m) and spindle speed (rad/s).

    Raises
    ------
    InputError
        A structure or a process that the simulated cell cannot represent, or no feed per tooth.
    """
    refuse_varied(process, "the simulated cut", "give straight edges at equal pitch, undamped", takes=("runout",))
    if not process.feed_per_tooth > 0:
        raise InputError("a simulated cut needs a feed; give feed_per_tooth_m in the cutting file")
    period = 2 * math.pi / (process.teeth * spindle_speed)
    highest = float(np.abs(structure.poles).max()) / (2 * math.pi)
    steps = max(SETTINGS.settling_steps_per_tooth, math.ceil(SETTINGS.settling_steps_per_period * highest * period))
    compile_kernels(*CUTTING, *SIMULATION)
    dynamics = discretise(replace(structure, residuals=None), period / steps)
    if structure.residuals is not None:
        dynamics = dynamics._replace(immediate=dynamics.immediate + structure.residuals.upper)
    memory = empty_memory(len(structure.poles), process.teeth, steps)
    tip = [structure.responses.index(label) for label in TIP]
    output = 2 * np.stack([structure.right.real, -structure.right.imag], axis=1)[:, :, tip].reshape(-1, len(tip))
    run = _Run(process, depth, steps, dynamics, memory, output)
    return _settling(run, process.teeth, min(SETTINGS.most_turns * process.teeth, SETTINGS.most_steps // steps))


class _Run:
    """The milling loop, run over a number of tooth periods at a time.

    ``output`` maps the modal history to the tip's displacement.
    """

    def __init__(
        self, process: MillingProcess, depth: float, steps: int, dynamics: Dynamics, memory: Memory, output: Real
    ) -> None:
        self._cut = prepare_cut(process, depth, material_named("homogeneous"), 0)
        self._pitch, self._steps = 2 * math.pi / process.teeth, steps
        self._offsets = np.zeros(process.teeth)
        self._dynamics, self._memory, self._output = dynamics, memory, output
        self._last_period = np.zeros((steps, 3))

    def deviations(self, n_periods: int) -> Real:
        """Return the largest deviation from the previous period for each of the next tooth periods, (n_periods,), m."""
        count, first = n_periods * self._steps, int(self._memory.counters[0])
        step = self._pitch / self._steps
        angles = step * np.arange(first, first + count, dtype=float)
        history, force = np.empty((count, len(self._memory.modal))), np.empty((count, 3))
        mill(angles, step, self._dynamics, self._cut, self._offsets, self._memory, force, history)
        motion = np.concatenate([self._last_period, history @ self._output])
        self._last_period = motion[-self._steps :]
        deviation = np.linalg.norm(motion[self._steps :] - motion[: -self._steps], axis=1)
        return np.asarray(deviation.reshape(n_periods, self._steps).max(axis=1))


def _settling(run: _Run, teeth: int, longest: int) -> Settling:
    """Run until the deviation has fallen enough or no longer falls, at most ``longest`` tooth periods."""
    block = 10 * teeth
    deviations = run.deviations(block)
    first = float(deviations.max())
    while len(deviations) < longest:
        deviations = np.concatenate([deviations, run.deviations(block)])
        share = float(deviations[-block:].max()) / first
        if share < SETTINGS.settled:
            return Settling("decays", len(deviations) / teeth, share)
        quarter = len(deviations) // 4
        grows = deviations[-quarter:].max() >= deviations[-2 * quarter : -quarter].max()
        if len(deviations) >= 40 * block and grows:
            return Settling("grows", len(deviations) / teeth, share)
    return Settling("open", len(deviations) / teeth, float(deviations[-block:].max()) / first)
