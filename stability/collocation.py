"""Stability limits of a modal model with coefficients as they vary, by spectral collocation."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from .circle_crossings import circle_crossings
from .delay_system import DelaySystem, delay_system
from .stability_limits import StabilityLimits
from .stability_lobes import StabilityLobes
from .varied_limits import varied_limits
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]


def collocation(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Lowest unstable depth at each speed; Hopf and period doubling.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.

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
    """All depths at which a Floquet multiplier crosses the unit circle, with frequency, kind and error.

    Each tooth period is collocated on pieces between entries and exits (Butcher et al. 2009; Insperger & Stepan 2011),
    and 1 / depth is found as an eigenvalue of the loop gain on the unit circle, so no grid of depths is needed. With a
    purely regenerative force there is no fold: at a multiplier of 1 the chip would be ``y - y_tau = 0``.

    Helical edges make the force a curved function of depth, unequal pitch gives several delays, process damping acts on
    velocity: such cuts are collocated over a tooth period or a turn, and depths are scanned (``varied_limits``).

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As :func:`collocation`.
    threads
        Over which the speeds are spread.

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
    expected: Real | None = None,
    threads: int = 1,
) -> StabilityLimits:
    """The lowest limit alone at each speed, several times faster than :func:`collocation_limits`.

    Depths are searched from zero up; at or just above an expected limit the search ends, and only where nothing has
    been found it goes on up to ``max_depth``. Islands below the limit are seen.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth, threads
        As :func:`collocation_limits`.
    expected : (n_speeds,), m
        Limits at speeds nearby, infinite where not known.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    speeds, system = _checked(structure, process, spindle_speeds, max_depth)
    if not process.is_plain:
        return varied_limits(system, speeds, float(max_depth))
    first = np.full(len(speeds), np.inf) if expected is None else np.asarray(expected, dtype=float)
    caps = np.minimum(1.2 * first, max_depth)
    jobs = [(chunk, float(caps[chunk].max())) for chunk in _chunks(speeds, caps)]
    parts = _in_parallel(system, speeds, jobs, True, threads)
    seen = np.zeros(len(speeds), dtype=bool)
    for part, (chunk, cap) in zip(parts, jobs, strict=True):
        seen[part[0]] = True
        seen[chunk] |= cap >= max_depth
    if not seen.all():
        rest = np.flatnonzero(~seen)
        parts += _in_parallel(system, speeds, [(rest[k], max_depth) for k in _chunks(speeds[rest])], True, threads)
    return _together(system, speeds, max_depth, parts)


_Part = tuple[Index, Real, Real, NDArray[np.bool_], Index, Real]
"""Index of the speed, depth, frequency, whether at pi, change and error of some crossings."""


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
    speed, depth, frequency, at_pi, change, error = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort([depth, speed])
    kinds = tuple(np.where(at_pi[order], "period-doubling", "hopf").tolist())
    return StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        kinds,
        change[order],
        error[order],
        "collocation",
        system.warnings,
    )


def _chunks(speeds: Real, depths: Real | None = None) -> list[Index]:
    """Indices of speeds, up to 32 together, that can share nodes.

    Their tooth periods differ by less than two fifths, and the depths of interest by less than a factor of 2.
    """
    octave = np.floor(np.log(speeds / speeds.min()) / np.log(1.4)).astype(int)
    if depths is not None:
        octave = 64 * octave + np.minimum(np.log2(depths.max() / depths), 63).astype(int)
    order = np.lexsort([speeds, octave])
    groups = np.split(order, np.flatnonzero(np.diff(octave[order])) + 1)
    return [part for group in groups for part in np.array_split(group, max(1, len(group) // 32))]


def _limits_of(system: DelaySystem, speeds: Real, chunk: Index, max_depth: float, lowest: bool) -> _Part:
    periods = 2 * np.pi / (system.process.teeth * speeds[chunk])
    found, frequency, error = circle_crossings(system, periods, max_depth, lowest=lowest)
    at_pi = found.theta == np.pi
    change = np.where(found.outward, 1, -1) * np.where(at_pi, 1, 2)
    return chunk[found.speed], found.depth, frequency, at_pi, change, error
