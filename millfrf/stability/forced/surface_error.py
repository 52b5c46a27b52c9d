"""Surface location error: where stable forced vibration leaves the wall, over spindle speed."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.core.compilation import FORCED, compile_kernels
from millfrf.cutting import ANY_MILL, MillingProcess, refuse_varied
from modal_fit import ModalModel

from ..floquet.multipliers import unstable_cuts
from ..milling_loop import delay_system
from ..settings import SETTINGS
from ..tip_receptance import tool_directions, tool_receptance
from .edge_passes import Structure, edge_discs
from .simulation import course_of

UP, DOWN = 0, 1


@dataclass(frozen=True)
class SurfaceError:
    """Location error of a wall over spindle speed and height.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the rows of ``error``.
    depth : m
        Axial depth of cut.
    wall
        ``up`` for the wall at immersion 0, ``down`` for that at 180 deg.
    heights : (n_heights,), m
        Heights above the tip.
    error : (n_speeds, n_heights), m
        Distance of the wall from its nominal place; positive: too much material is removed (overcut).
    stable : (n_speeds,)
        Whether the cut is stable; elsewhere the error has no meaning. None: not known, for an FRF.
    unmeasured : (n_speeds,)
        Share of the motion across the wall whose frequencies lie outside the band in which the structure was measured.
    """

    spindle_speeds: Real
    depth: float
    wall: str
    heights: Real
    error: Real
    stable: NDArray[np.bool_] | None
    unmeasured: Real


def wall_of(process: MillingProcess) -> int:
    """Return which end of the engagement makes a wall; that of up milling in a slot.

    Raises
    ------
    InputError
        An engagement that begins above 0 and ends below 180 deg makes no wall.
    """
    if process.start_angle < 1e-9:
        return UP
    if process.exit_angle > math.pi - 1e-9:
        return DOWN
    raise InputError(
        f"an engagement from {math.degrees(process.start_angle):.4g} to {math.degrees(process.exit_angle):.4g} deg "
        "makes no wall; a wall is made where a tooth enters at 0 or leaves at 180 deg"
    )


def surface_error(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, depth: float
) -> SurfaceError:
    """Compute the location error of the wall from the forced vibration of a stable cut.

    Without chatter the motion repeats every turn, and the force on equal teeth is that on a rigid tool: its harmonics
    ``F_k`` at ``k`` times the spindle frequency move the tip by ``X_k = H(2 pi i k f) F_k``. The wall is where the edge
    stands that reaches farthest as it passes the wall, at each height (Schmitz & Mann, International Journal of Machine
    Tools and Manufacture 46, 2006, 1369-1377). Where teeth differ, the change of the chips by the motion is left out,
    and so is process damping. The mean deflection is that of the flexibility below the lowest mode or line.

    Parameters
    ----------
    structure
        Modal model, or FRF in m/N, at the tool. Between 0 Hz and the lowest line an FRF keeps the value of that line.
    process
        Cutter, engagement and coefficients.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which the wall is wanted.
    depth : m
        Axial depth of cut.

    Returns
    -------
    SurfaceError
        Error over speed and height.

    Raises
    ------
    InputError
        No feed, no wall, no receptance across it, a speed or depth that is not positive, or an unusable structure.
    """
    refuse_varied(process, "the error of the wall", "its limits: millfrf lobes", takes=ANY_MILL)
    if not process.feed_per_tooth > 0:
        raise InputError("the wall needs the chip's thickness: give feed_per_tooth_m in the cutting file")
    speeds = np.atleast_1d(np.asarray(spindle_speeds, dtype=float))
    if not (np.isfinite(speeds).all() and speeds.min() > 0 and math.isfinite(depth) and depth > 0):
        raise InputError(f"spindle speeds and the depth, {depth!r} m, must be positive and finite")
    directions = tool_directions(structure)
    if not (1 in directions.responses.axes and 1 in directions.excitations.axes):
        raise InputError("force and motion across the wall were not measured: tap the tool in Y of the cut, too")
    wall, source = wall_of(process), tool_receptance(structure)
    low, high = structure.band or source.span
    steps = _steps(process, source.span[1], float(speeds.min()))
    force, heights, passing = _rigid_cut(process, depth, steps, wall)
    harmonics = np.fft.rfft(force, axis=0)
    numbers = np.arange(len(harmonics))
    error, unmeasured = np.empty((len(speeds), len(heights))), np.empty(len(speeds))
    for k, speed in enumerate(speeds):
        frequencies = numbers * speed / (2 * np.pi)
        known = np.clip(frequencies, source.span[0], np.inf if source.open_above else source.span[1])
        lines = np.einsum("kab,kb->ka", source.evaluate(known), harmonics)
        lines[frequencies > (np.inf if source.open_above else source.span[1])] = 0.0
        lines[0] = lines[0].real
        outward = np.fft.irfft((1 - 2 * wall) * lines[:, 1], n=steps)
        error[k] = passing(outward)
        power = np.abs(lines[:, 1]) ** 2
        outside = (frequencies < low) | (frequencies > high)
        outside[0] = False  # the static deflection follows from the flexibility at the band's lower end
        unmeasured[k] = math.sqrt(power[outside].sum() / max(power[1:].sum(), 1e-300))
    stable = None
    if isinstance(structure, ModalModel):
        system = delay_system(structure, process)
        stable = ~unstable_cuts(system, speeds, np.full(len(speeds), depth))
    return SurfaceError(speeds, depth, ("up", "down")[wall], heights, error, stable, unmeasured)


def _steps(process: MillingProcess, highest: float, slowest: float) -> int:
    """Return an even number of steps in a turn that resolves a frequency (Hz) at the slowest speed (rad/s)."""
    lines = 2 * SETTINGS.lines_above * highest * 2 * math.pi / slowest
    return 2 * math.ceil(min(max(lines, SETTINGS.steps_per_tooth * process.teeth), SETTINGS.most_steps) / 2)


def _rigid_cut(
    process: MillingProcess, depth: float, steps: int, wall: int
) -> tuple[Real, Real, Callable[[Real], Real]]:
    """Return the force on a rigid tool over a turn, the heights, and what a motion over a turn leaves at the wall.

    The last takes the motion out of the wall (steps,), m, and returns the outermost edge at each height (n_heights,).
    """
    compile_kernels(*FORCED)
    none = np.zeros((0, 3), dtype=complex)
    rigid = Structure(np.zeros(0, dtype=complex), none, none, np.zeros((3, 3)))
    turns = 3  # in the first, edges cut the surface of the start; with runout the second may differ still
    course, heights = course_of(process, depth, np.full(turns * steps, 1.0), steps, rigid)
    discs = edge_discs(process, depth)
    aheads = np.array(process.tooth_angles)[:, None]
    at_wall = np.mod(wall * np.pi - aheads + discs.lags, 2 * np.pi)
    axis = 2 * np.pi * np.arange(1, steps + 1) / steps

    def passing(outward: Real) -> Real:
        reached = np.interp(at_wall, axis, outward, period=2 * np.pi) + discs.offsets
        return np.asarray(reached.max(axis=0))

    return course.force[-steps:], heights, passing
