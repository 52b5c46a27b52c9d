"""Limits of cuts whose force is not linear in depth or has several delays, from their Floquet multipliers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..floquet import VariedCut, varied_cut
from ..lobes import StabilityLimits
from ..milling_loop import DelaySystem

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
