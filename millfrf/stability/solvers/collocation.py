"""Stability limits by spectral collocation of the tooth period."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from estimation import Frf
from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..floquet.varied_edges import VariedCut, varied_cut
from ..lobes_result import StabilityLimits, StabilityLobes
from ..milling_loop import DelaySystem, delay_system
from ..roots.unit_circle import CircleCrossings, circle_crossings
from .zero_order import checked_speeds


@dataclass(frozen=True)
class _Limit:
    depth: float
    frequency: float
    kind: str
    change: int
    error: float


def varied_limits(
    system: DelaySystem, speeds: Real, max_depth: float, *, n_depths: int = 48, tolerance: float = 1e-7
) -> StabilityLimits:
    """Find all depths at which multipliers cross the unit circle, by a scan over depth and halving.

    A crossing is where the number of unstable multipliers changes between two depths of the scan; an island thinner
    than a step, ``max_depth / n_depths``, may be missed, and the result says so. The stated error is what five more
    nodes on each piece change, to first order.

    Parameters
    ----------
    system
        Structure and process.
    speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.
    n_depths
        Number of steps of the scan.
    tolerance
        Largest error of a depth, as a share of ``max_depth``.
    """
    found = [
        (k, limit) for k, speed in enumerate(speeds) for limit in _at(system, speed, max_depth, n_depths, tolerance)
    ]
    warning = f"depths were scanned in steps of {1e3 * max_depth / n_depths:.3g} mm; a thinner island may be missed"
    limits = [limit for _, limit in found]
    return StabilityLimits(
        speeds,
        float(max_depth),
        np.array([k for k, _ in found], dtype=np.int64),
        np.array([limit.depth for limit in limits]),
        np.array([limit.frequency for limit in limits]),
        tuple(limit.kind for limit in limits),
        np.array([limit.change for limit in limits], dtype=np.int64),
        np.array([limit.error for limit in limits]),
        "collocation",
        (*system.warnings, warning),
    )


def _at(system: DelaySystem, speed: float, max_depth: float, n_depths: int, tolerance: float) -> list[_Limit]:
    scan = np.linspace(0, max_depth, n_depths + 1)
    counts = [0] + [_unstable(system, speed, float(depth)) for depth in scan[1:]]
    limits = []
    for low, high, before, after in zip(scan, scan[1:], counts, counts[1:], strict=False):
        begin, count = float(low), before
        while count != after and high - begin > 2 * tolerance * max_depth:
            limit = _halved(system, speed, (begin, float(high)), count, tolerance * max_depth)
            limits.append(limit)
            begin, count = limit.depth + tolerance * max_depth, count + limit.change
    return limits


def _unstable(system: DelaySystem, speed: float, depth: float) -> int:
    return int((np.abs(np.linalg.eigvals(varied_cut(system, speed, depth).monodromy)) > 1).sum())


def _halved(system: DelaySystem, speed: float, bracket: tuple[float, float], before: int, tolerance: float) -> _Limit:
    low, high = bracket
    last = _unstable(system, speed, high)
    while high - low > tolerance:
        middle = (low + high) / 2
        count = _unstable(system, speed, middle)
        if count == before:
            low = middle
        else:
            high, last = middle, count
    depth = (low + high) / 2
    cut = varied_cut(system, speed, depth)
    values, vectors = np.linalg.eig(cut.monodromy)
    critical = int(np.argmin(np.abs(np.abs(values) - 1)))
    value = complex(values[critical])
    step = max(1e-4 * depth, 2 * tolerance)
    aside = _nearest(varied_cut(system, speed, depth + step), value)
    slope = (abs(aside) - abs(value)) / step
    finer = _nearest(varied_cut(system, speed, depth, extra=5), value)
    error = abs(abs(finer) - abs(value)) / max(abs(slope), 1e-300) + tolerance
    frequency = _strongest_line(system, cut, value, vectors[:, critical])
    return _Limit(depth, frequency, _kind(value), last - before, float(error))


def critical_motion(system: DelaySystem, speed: float, depth: float) -> tuple[float, str]:
    """Frequency (Hz) of the strongest line, and kind, of the motion whose multiplier is the largest at a cut."""
    cut = varied_cut(system, speed, depth)
    values, vectors = np.linalg.eig(cut.monodromy)
    critical = int(np.argmax(np.abs(values)))
    value = complex(values[critical])
    return _strongest_line(system, cut, value, vectors[:, critical]), _kind(value)


def _kind(value: complex) -> str:
    if abs(value.imag) > 1e-6:
        return "hopf"
    return "fold" if value.real > 0 else "period-doubling"


def _nearest(cut: VariedCut, value: complex) -> complex:
    values = np.linalg.eigvals(cut.monodromy)
    return complex(values[np.argmin(np.abs(values - value))])


def _strongest_line(system: DelaySystem, cut: VariedCut, value: complex, vector: Complex) -> float:
    """Give the line of the critical motion at which the tool moves most, Hz."""
    force = (cut.force @ vector).reshape(len(cut.times), -1)
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * cut.period / (2 * np.pi))) + 1
    lines = (np.angle(value) + 2 * np.pi * np.arange(-top, top + 1)) / cut.period
    spectrum = np.exp(-1j * np.outer(lines, cut.times)) @ (force * cut.weights[:, None])
    motion = np.zeros((len(lines), 3), dtype=complex)
    left = system.left[:, cut.directions]
    for pole, right, push in zip(system.poles, system.right, left, strict=True):
        motion += (spectrum @ push / (1j * lines - pole))[:, None] * right
        motion += (spectrum @ push.conj() / (1j * lines - pole.conj()))[:, None] * right.conj()
    return float(abs(lines[np.argmax(np.linalg.norm(motion, axis=1))]) / (2 * np.pi))


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
