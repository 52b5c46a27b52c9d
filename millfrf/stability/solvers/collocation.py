"""Stability limits by spectral collocation of the tooth period."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from estimation import Frf
from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..floquet.critical_lines import CircleCrossings, circle_crossings
from ..floquet.cut_period import CollocatedCut, collocated_cut
from ..floquet.growth import force_at_nodes, leading_multipliers
from ..floquet.multipliers import kind_of
from ..lobes_result import StabilityLimits, StabilityLobes
from ..milling_loop import DelaySystem, delay_system, speed_groups
from .zero_order import checked_speeds


def collocation(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Compute the lowest unstable depth at each speed; Hopf and period doubling.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
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

    Helical edges make the force a nonlinear function of depth, unequal pitch gives several delays, and process damping
    acts on velocity: such cuts are collocated over a tooth period or a turn, and depths are scanned.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        Modal model at the tool tip, cut, speeds (rad/s) and largest depth (m), as for :func:`collocation`.
    threads
        Number of threads over which the speeds are distributed.

    Raises
    ------
    InputError
        Speeds or depth not positive, an FRF (fit it, or use ``multi_frequency``), or a structure that cannot be used.
    """
    return _limits(structure, process, spindle_speeds, max_depth, lowest=False, threads=threads)


def lowest_limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    threads: int = 1,
) -> StabilityLimits:
    """Find only the lowest limit at each speed, several times faster than :func:`collocation_limits`.

    Depths are searched upwards from zero. The search ends with the first row of cells that contains a limit, so that an
    island of instability below a further limit is not missed.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth, threads
        Modal model, cut, speeds (rad/s), largest depth (m) and threads, as for :func:`collocation_limits`.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    return _limits(structure, process, spindle_speeds, max_depth, lowest=True, threads=threads)


def _limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    lowest: bool,
    threads: int,
) -> StabilityLimits:
    if isinstance(structure, Frf):
        raise InputError("collocation needs a modal model, this is an FRF; fit it first, or use multi-frequency")
    speeds, system = checked_speeds(spindle_speeds, max_depth), delay_system(structure, process)
    if not process.is_plain:
        return varied_limits(system, speeds, float(max_depth))

    def crossings(group: Index) -> CircleCrossings:
        return circle_crossings(system, 2 * np.pi / (process.teeth * speeds[group]), max_depth, lowest=lowest)

    # groups of up to 32 speeds, whose tooth periods differ by less than two fifths, share nodes
    groups = [part for group in speed_groups(speeds, 1.4) for part in np.array_split(group, max(1, len(group) // 32))]
    with ThreadPoolExecutor(max(1, threads)) as pool:
        results = list(pool.map(crossings, groups))
    return _joined(system, speeds, max_depth, groups, results)


def _joined(
    system: DelaySystem, speeds: Real, max_depth: float, groups: list[Index], results: list[CircleCrossings]
) -> StabilityLimits:
    speed = np.concatenate([group[result.crossings.speed] for group, result in zip(groups, results, strict=True)])
    depth, theta, outward = (
        np.concatenate([getattr(result.crossings, name) for result in results])
        for name in ("depth", "theta", "outward")
    )
    frequency, error = (
        np.concatenate([getattr(result, name) for result in results]) for name in ("frequency", "error")
    )
    resolved = np.empty(len(speeds))
    for group, result in zip(groups, results, strict=True):
        resolved[group] = result.resolved
    order = np.lexsort([depth, speed])
    at_pi = theta[order] == np.pi
    return StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        tuple(np.where(at_pi, "period-doubling", "hopf").tolist()),
        np.where(outward[order], 1, -1) * np.where(at_pi, 1, 2),  # a Hopf crossing is one of a conjugate pair
        error[order],
        "collocation",
        system.warnings,
        resolved,
    )


@dataclass(frozen=True)
class _Limit:
    """One limit of `StabilityLimits`."""

    depth: float
    frequency: float
    kind: str
    change: int
    error: float


def varied_limits(system: DelaySystem, speeds: Real, max_depth: float, *, tolerance: float = 1e-7) -> StabilityLimits:
    """Find all depths at which multipliers cross the unit circle, by a scan over depth and bisection.

    A crossing lies between two depths of the scan with different numbers of unstable multipliers. An island thinner
    than one of the 48 steps may be missed, and a warning says so. The stated error is the first-order effect of five
    more nodes in each piece. ``speeds`` (n_speeds,) are in rad/s; ``tolerance`` is the largest error of a depth as a
    share of ``max_depth`` (m).
    """
    n_depths = 48
    pairs = [
        (k, limit)
        for k, speed in enumerate(speeds)
        for limit in _scanned(system, speed, max_depth, n_depths, tolerance * max_depth)
    ]
    warning = f"depths were scanned in steps of {1e3 * max_depth / n_depths:.3g} mm; a thinner island may be missed"
    limits = [limit for _, limit in pairs]
    return StabilityLimits(
        speeds,
        float(max_depth),
        np.array([k for k, _ in pairs], dtype=np.int64),
        np.array([limit.depth for limit in limits]),
        np.array([limit.frequency for limit in limits]),
        tuple(limit.kind for limit in limits),
        np.array([limit.change for limit in limits], dtype=np.int64),
        np.array([limit.error for limit in limits]),
        "collocation",
        (*system.warnings, warning),
    )


def _scanned(system: DelaySystem, speed: float, max_depth: float, n_depths: int, tolerance: float) -> list[_Limit]:
    scan = np.linspace(0, max_depth, n_depths + 1)
    counts = [0] + [_unstable(system, speed, float(depth)) for depth in scan[1:]]
    limits = []
    for (low, high), (before, after) in zip(pairwise(scan), pairwise(counts), strict=True):
        begin, count = float(low), before
        # several multipliers may cross within one step
        while count != after and high - begin > 2 * tolerance:
            limit = _bisected(system, speed, (begin, float(high)), count, tolerance)
            limits.append(limit)
            begin, count = limit.depth + tolerance, count + limit.change
    return limits


def _unstable(system: DelaySystem, speed: float, depth: float) -> int:
    values = leading_multipliers(collocated_cut(system, speed, depth), floor=1.0).values
    return int((np.abs(values) > 1).sum())


def _bisected(system: DelaySystem, speed: float, bracket: tuple[float, float], before: int, tolerance: float) -> _Limit:
    low, high = bracket
    above = _unstable(system, speed, high)
    while high - low > tolerance:
        middle = (low + high) / 2
        count = _unstable(system, speed, middle)
        if count == before:
            low = middle
        else:
            high, above = middle, count
    depth = (low + high) / 2
    cut = collocated_cut(system, speed, depth)
    leading = leading_multipliers(cut, floor=0.9)
    critical = int(np.argmin(np.abs(np.abs(leading.values) - 1)))
    value = complex(leading.values[critical])
    step = max(1e-4 * depth, 2 * tolerance)
    slope = (abs(_nearest(collocated_cut(system, speed, depth + step), value)) - abs(value)) / step
    finer = _nearest(collocated_cut(system, speed, depth, extra=5), value)
    error = abs(abs(finer) - abs(value)) / max(abs(slope), 1e-300) + tolerance
    frequency = strongest_force_line(system, cut, value, leading.vectors[:, critical])
    return _Limit(depth, frequency, kind_of(value), above - before, float(error))


def _nearest(cut: CollocatedCut, value: complex) -> complex:
    values = leading_multipliers(cut, floor=0.8).values
    return complex(values[np.argmin(np.abs(values - value))])


def strongest_force_line(system: DelaySystem, cut: CollocatedCut, value: complex, vector: Complex) -> float:
    """Compute the frequency (Hz) at which the tool's motion with a multiplier and its vector is largest."""
    force = force_at_nodes(cut, vector)
    top = int(np.ceil(1.5 * np.abs(system.poles).max() * cut.duration / (2 * np.pi))) + 1
    lines = (np.angle(value) + 2 * np.pi * np.arange(-top, top + 1)) / cut.duration
    spectrum = np.exp(-1j * np.outer(lines, cut.times)) @ (force * cut.weights[:, None])
    motion = np.zeros((len(lines), 3), dtype=complex)
    for pole, right, left in zip(system.poles, system.right, system.left[:, cut.directions], strict=True):
        motion += (spectrum @ left / (1j * lines - pole))[:, None] * right
        motion += (spectrum @ left.conj() / (1j * lines - pole.conj()))[:, None] * right.conj()
    return float(abs(lines[np.argmax(np.linalg.norm(motion, axis=1))]) / (2 * np.pi))
