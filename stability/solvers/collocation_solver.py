"""Stability limits of a modal model with coefficients as they vary, by spectral collocation."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from ..characteristic_roots.unit_circle import CircleCrossings, circle_crossings
from ..lobes.stability_limits import StabilityLimits
from ..lobes.stability_lobes import StabilityLobes
from ..milling_loop.delayed_state import DelaySystem, delay_system
from .varied_limits import varied_limits
from .zero_order_solver import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]


def collocation(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Give the lowest unstable depth at each speed; Hopf and period doubling.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    return lowest_limits(structure, process, spindle_speeds, max_depth).lowest()


def collocation_limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    threads: int = 1,
) -> StabilityLimits:
    """Find all depths at which a Floquet multiplier crosses the unit circle, with frequency, kind and error.

    Each tooth period is collocated on pieces between entries and exits (Butcher et al. 2009; Insperger & Stepan 2011),
    and 1 / depth is found as an eigenvalue of the loop gain on the unit circle, so no grid of depths is needed. With a
    purely regenerative force there is no fold: at a multiplier of 1 the chip would be ``y - y_tau = 0``.

    Helical edges make the force a curved function of depth, unequal pitch gives several delays, process damping acts on
    velocity: such cuts are collocated over a tooth period or a turn, and depths are scanned (``varied_limits``).

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        Modal model at the tool tip, cut, speeds (rad/s) and largest depth (m), as for :func:`collocation`.
    threads
        Number of threads over which the speeds are spread.

    Raises
    ------
    InputError
        Speeds or depth not positive, an FRF (fit it, or take ``multi_frequency``), or a structure that cannot be used.
    """
    speeds, system = _checked(structure, process, spindle_speeds, max_depth)
    if not process.is_plain:
        return varied_limits(system, speeds, float(max_depth))
    parts = _in_parallel(system, speeds, [(chunk, max_depth) for chunk in _chunks(speeds)], False, threads)
    return _together(system, speeds, max_depth, parts)


def lowest_limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    threads: int = 1,
) -> StabilityLimits:
    """Find the lowest limit alone at each speed, several times faster than :func:`collocation_limits`.

    Depths are searched from zero up, and the search ends with the row of cells in which a limit has been found.
    Islands below the limit are seen.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth, threads
        Modal model, cut, speeds (rad/s), largest depth (m) and threads, as for :func:`collocation_limits`.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    speeds, system = _checked(structure, process, spindle_speeds, max_depth)
    if not process.is_plain:
        return varied_limits(system, speeds, float(max_depth))
    parts = _in_parallel(system, speeds, [(chunk, max_depth) for chunk in _chunks(speeds)], True, threads)
    return _together(system, speeds, max_depth, parts)


_Part = tuple[Index, CircleCrossings]
"""Indices of some speeds, and their crossings."""


def _checked(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> tuple[Real, DelaySystem]:
    if isinstance(structure, Frf):
        raise InputError("collocation needs a modal model, this is an FRF; fit it first, or use multi-frequency")
    return checked_speeds(spindle_speeds, max_depth), delay_system(structure, process)


def _in_parallel(
    system: DelaySystem, speeds: Real, jobs: list[tuple[Index, float]], lowest: bool, threads: int
) -> list[_Part]:
    """Solve for chunks of speeds, each up to its depth."""
    with ThreadPoolExecutor(max(1, threads)) as pool:
        return list(pool.map(lambda job: _limits_of(system, speeds, job[0], job[1], lowest), jobs))


def _together(system: DelaySystem, speeds: Real, max_depth: float, parts: list[_Part]) -> StabilityLimits:
    speed = np.concatenate([chunk[part.crossings.speed] for chunk, part in parts])
    depth, theta, outward = (
        np.concatenate([getattr(part.crossings, name) for _, part in parts]) for name in ("depth", "theta", "outward")
    )
    frequency, error = (np.concatenate([getattr(part, name) for _, part in parts]) for name in ("frequency", "error"))
    resolved = np.empty(len(speeds))
    for chunk, part in parts:
        resolved[chunk] = part.resolved
    order = np.lexsort([depth, speed])
    at_pi = theta[order] == np.pi
    return StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        tuple(np.where(at_pi, "period-doubling", "hopf").tolist()),
        np.where(outward[order], 1, -1) * np.where(at_pi, 1, 2),
        error[order],
        "collocation",
        system.warnings,
        resolved,
    )


def _chunks(speeds: Real) -> list[Index]:
    """Indices of speeds, up to 32 together, whose tooth periods differ by less than two fifths: they share nodes."""
    octave = np.floor(np.log(speeds / speeds.min()) / np.log(1.4)).astype(int)
    order = np.lexsort([speeds, octave])
    groups = np.split(order, np.flatnonzero(np.diff(octave[order])) + 1)
    return [part for group in groups for part in np.array_split(group, max(1, len(group) // 32))]


def _limits_of(system: DelaySystem, speeds: Real, chunk: Index, max_depth: float, lowest: bool) -> _Part:
    periods = 2 * np.pi / (system.process.teeth * speeds[chunk])
    return chunk, circle_crossings(system, periods, max_depth, lowest=lowest)
