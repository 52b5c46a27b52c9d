"""Simulation of a cut in the time domain, with run-in, loss of contact, runout and any cutter."""

import math
from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.compilation import FORCED, compile_kernels
from millfrf.cutting import ANY_MILL, MillingProcess, refuse_varied
from modal_fit import ModalModel

from ..milling_loop import DelaySystem, delay_system
from ..settings import SETTINGS, THRESHOLDS
from ..speed_variation import SpeedVariation
from .edge_passes import Course, Structure, cut_in_time, edge_discs, pass_edges


@dataclass(frozen=True)
class SimulatedCut:
    """Motion and force of a cut in the time domain.

    Parameters
    ----------
    times : (n,), s
        Instants, equally spaced in the spindle's angle.
    motion : (n, 3), m
        Motion of the tool tip in X, Y, Z.
    force : (n, 3), N
        Force on the tool in X, Y, Z.
    chip : (n,), m
        Thickest chip of all edges; zero: no edge cuts.
    steps
        Instants in a turn.
    heights : (n_heights,), m
        Heights above the tip at which the walls are given.
    walls : (n_turns, 2, n_heights), m
        By how much the outermost pass of each turn goes beyond the nominal wall at immersion 0 (up milling) and
        180 deg (down milling); positive: overcut; not finite: no wall.
    unsteadiness
        Share of the motion in the last quarter that differs from that a tooth passing before, both as root mean
        squares; from that a turn before where teeth differ, and from that of the last period of a varied speed. With
        runout and an even number of teeth, period doubling repeats every turn, too. Infinite: the simulation ended
        where the tool moved by more than its radius.
    """

    times: Real
    motion: Real
    force: Real
    chip: Real
    steps: int
    heights: Real
    walls: Real
    unsteadiness: float

    @property
    def repeats(self) -> bool:
        """Return whether the motion has settled to one that repeats; otherwise the cut chatters."""
        return self.unsteadiness < SETTINGS.unsteady

    @property
    def outcome(self) -> str:
        """Return in words whether the motion repeats at the end of the simulation."""
        turns = f"{len(self.times) // self.steps} turns"
        if math.isinf(self.unsteadiness):
            return f"the tool moves by more than its radius after {turns}"
        if self.repeats:
            return f"the motion repeats to {100 * self.unsteadiness:.2g} % of it at the end of {turns}"
        return f"{100 * self.unsteadiness:.3g} % of the motion does not repeat at the end of {turns}"


def simulate_cut(
    model: ModalModel,
    process: MillingProcess,
    spindle_speed: float,
    depth: float,
    *,
    turns: int | None = None,
    variation: SpeedVariation | None = None,
) -> SimulatedCut:
    """Simulate a cut from rest, in a surface that earlier passes left without vibration.

    The edges are discs of the cutter; each place of the surface is the deepest that a pass of the last turn left, so
    that an edge that jumps out of the cut leaves the surface to the next ones (Schmitz & Smith, Machining Dynamics,
    2nd ed., section 4.4). The modes are exact for a force that is linear over a step.

    Parameters
    ----------
    model
        Receptance in m/N at the tool.
    process
        Cutter, engagement and coefficients; any shape, helix, pitch, runout and process damping.
    spindle_speed : rad/s
        Spindle speed, the mean one with a variation.
    depth : m
        Axial depth of cut.
    turns
        Revolutions; None: as many as let the slowest mode decay to a millionth, at least 40, and at least four periods
        of a varied speed; while what does not repeat halves with four times as many, the simulation goes on.
    variation
        Variation of the spindle speed; None: constant.

    Returns
    -------
    SimulatedCut
        Motion, force, chip and walls.

    Raises
    ------
    InputError
        No feed, a speed or depth that is not positive, fewer turns than two periods of a varied speed, or a cut so deep
        that the first turn moves the tool too far.
    """
    refuse_varied(process, "the simulation in time", "its limits: millfrf lobes", takes=ANY_MILL)
    if not process.feed_per_tooth > 0:
        raise InputError("a simulation needs the chip's thickness: give feed_per_tooth_m in the cutting file")
    for name, value in (("spindle speed", spindle_speed), ("depth", depth)):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} {value!r} must be positive and finite")
    system = delay_system(model, process)
    compile_kernels(*FORCED)
    period = 1 if variation is None else variation.tooth_passings(1)
    if turns is not None and variation is not None and turns < 2 * period:
        raise InputError(f"{turns} turns are less than two periods of the varied speed; give {2 * period} or more")
    if turns is not None:
        return _simulated(system, spindle_speed, depth, turns, variation)
    turns = max(turns_to_settle(system, spindle_speed), 4 * period)
    cut = _simulated(system, spindle_speed, depth, turns, variation)
    for longer in (4 * turns, 16 * turns):
        if cut.repeats or np.isinf(cut.unsteadiness) or cut.steps * longer > SETTINGS.most_instants:
            break
        before, cut = cut, _simulated(system, spindle_speed, depth, longer, variation)
        if cut.unsteadiness > before.unsteadiness / 2:
            break
    return cut


def turns_to_settle(system: DelaySystem, spindle_speed: float) -> int:
    """Return the revolutions in which the slowest mode decays to a millionth, but enough to be judged for chatter.

    These are two more than :func:`classify_cut` needs, as a recording may begin and end within a revolution.
    """
    slowest = float(-system.poles.real.max())
    return max(THRESHOLDS.least_revolutions + 2, math.ceil(math.log(1e6) / slowest * spindle_speed / (2 * math.pi)))


def _simulated(
    system: DelaySystem, speed: float, depth: float, turns: int, variation: SpeedVariation | None
) -> SimulatedCut:
    steps = steps_per_turn(system, speed * (1 - (variation.amplitude if variation else 0.0)))
    if steps * turns > SETTINGS.most_instants:
        raise InputError(
            f"{turns} turns of {steps} steps are too long to simulate; give fewer turns, or a model without modes far "
            "above the tooth passing"
        )
    angles = 2 * np.pi * (np.arange(steps * turns) + 0.5) / steps
    durations = (variation or SpeedVariation(0.0, 1.0)).durations(angles, 2 * np.pi / steps, speed)
    structure = Structure(
        system.poles + 0j, np.ascontiguousarray(system.right), np.ascontiguousarray(system.left), system.upper + 0.0
    )
    course, heights = course_of(system.process, depth, durations, steps, structure)
    wide = ~(np.abs(course.motion).max(axis=1) < system.process.diameter / 2)
    count = int(np.argmax(wide)) if wide.any() else len(wide)
    if count < steps:
        raise InputError(
            f"the tool moves by more than its radius in the first turn at {1e3 * depth:g} mm; cut less deep"
        )
    return SimulatedCut(
        np.cumsum(durations)[:count],
        course.motion[:count],
        course.force[:count],
        course.chip[:count],
        steps,
        heights,
        course.walls[: count // steps],
        math.inf if wide.any() else _unsteadiness(course.motion, _period(system.process, steps, variation)),
    )


def steps_per_turn(system: DelaySystem, speed: float) -> int:
    """Return steps, an even number between two teeth, that resolve the highest mode and the passage of a tooth."""
    highest = float(np.abs(system.poles).max()) if len(system.poles) else 0.0
    teeth = system.process.teeth
    return 2 * teeth * math.ceil(max(SETTINGS.steps_per_period * highest / speed / teeth, SETTINGS.steps_per_tooth) / 2)


def course_of(
    process: MillingProcess, depth: float, durations: Real, steps: int, structure: Structure
) -> tuple[Course, Real]:
    """Run the compiled simulation over steps of given durations (s); return its course and the discs' heights (m)."""
    discs, count = edge_discs(process, depth), len(durations)
    walls = np.full((-(-count // steps), 2, len(discs.widths)), -np.inf)
    course = Course(np.empty((count, 3)), np.empty((count, 3)), np.empty(count), walls)
    pass_edges(durations, steps, discs, cut_in_time(process), structure, course)
    return course, discs.heights


def _period(process: MillingProcess, steps: int, variation: SpeedVariation | None) -> int:
    """Return the steps after which the motion of a stable cut repeats: those of a tooth, or of a turn.

    At a varied speed it repeats when teeth and speed do.
    """
    teeth = process.teeth if _equal_teeth(process) else 1
    return steps // teeth * (1 if variation is None else variation.tooth_passings(teeth))


def _equal_teeth(process: MillingProcess) -> bool:
    return process.equal_pitch and process.runout == 0 and len(set(process.helices)) == 1 and not process.has_offsets


def _unsteadiness(motion: Real, period: int) -> float:
    """Return the share of the motion in the last quarter that a period (steps) before was different."""
    last = max(period, len(motion) // 4)
    late = motion[-last:]
    change = late - motion[-last - period : -period] if len(motion) >= last + period else late
    size = float(np.sqrt(np.mean((late - late.mean(axis=0)) ** 2)))
    return float(np.sqrt(np.mean(change**2))) / size if size > 0 else 0.0
