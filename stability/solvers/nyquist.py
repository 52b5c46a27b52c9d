"""Nyquist's criterion on the averaged loop: stable or not, without a fit."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, average_directional_matrix, damping_harmonics
from estimation import Frf
from modal_fit import ModalModel

from ..lobes.stability_lobes import StabilityLobes
from ..milling_loop.tip_receptance import ToolReceptance, reaching, tool_receptance
from .zero_order_solver import averaged, checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def unstable_poles(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speed: float, depths: Real
) -> NDArray[np.int64]:
    """Count the unstable closed-loop pole pairs at each depth, by encirclements of the origin.

    ``det[I - a K_tc alpha_0 mean_j(1 - exp(-s tau_j)) H(s)]`` is followed along the positive imaginary axis, process
    damping added as ``a s (C / V) P_0 H``; the structure itself is stable, so each turn of its argument by -2 pi is one
    unstable pair (Nyquist 1932; Mohammadi & Ahmadi, Eq. 5). Below and above the known span the receptance is taken to
    be so small that the determinant stays near its end value.

    Parameters
    ----------
    structure, process
        Receptance and cut, as for :func:`zero_order`.
    spindle_speed : rad/s
        Spindle speed of the cut.
    depths : (n_depths,), m
        Axial depths at which poles are counted.

    Returns
    -------
    (n_depths,)
    """
    return _turns(tool_receptance(structure), process, float(spindle_speed), np.atleast_1d(depths))


def is_stable(structure: Frf | ModalModel, process: MillingProcess, spindle_speed: float, depth: float) -> bool:
    """Whether a cut at ``spindle_speed`` (rad/s) and ``depth`` (m) is stable by Nyquist's criterion."""
    return bool(unstable_poles(structure, process, spindle_speed, np.array([depth]))[0] == 0)


def _turns(source: ToolReceptance, process: MillingProcess, speed: float, depths: Real) -> NDArray[np.int64]:
    step = speed / (24 * max(process.pitches))
    counts = np.maximum(1, np.ceil(np.diff(source.grid) / step)).astype(int)
    pieces = [
        np.linspace(a, b, n, endpoint=False) for a, b, n in zip(source.grid, source.grid[1:], counts, strict=False)
    ]
    frequencies = np.append(np.concatenate(pieces), source.grid[-1])
    loop = _averaged_loop(process, speed, source.evaluate(frequencies), frequencies)
    # det(I - a L) = 1 - a c1 + a^2 c2 - a^3 c3 with the principal minors of L
    first = np.trace(loop, axis1=1, axis2=2)
    second = (first**2 - np.trace(loop @ loop, axis1=1, axis2=2)) / 2
    third = np.linalg.det(loop)
    a = depths[:, None]
    determinant = 1 - a * first + a**2 * second - a**3 * third
    turned = np.angle(determinant[:, 1:] / determinant[:, :-1]).sum(axis=1)
    ends = np.angle(determinant[:, -1]) - np.angle(determinant[:, 0])
    return np.asarray(np.round((ends - turned) / (2 * np.pi)).astype(np.int64))


def nyquist_limits(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float, *, n_depths: int = 60
) -> StabilityLobes:
    """Lowest unstable depth at each speed, found by counting encirclements and bisection.

    Depths are scanned in ``n_depths`` steps, so that an unstable island thinner than a step may be missed; the limit is
    then halved down to 1e-6 of the largest depth. Works on a measured FRF without a fit.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As for :func:`zero_order`.
    n_depths
        Steps of the first scan.

    Raises
    ------
    InputError
        As :func:`zero_order`.
    """
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = reaching(tool_receptance(structure), process.ktc * average_directional_matrix(process), max_depth)
    limits = np.full(len(speeds), np.inf)
    chatter = np.full(len(speeds), np.nan)
    scan = np.linspace(max_depth / n_depths, max_depth, n_depths)
    for k, speed in enumerate(speeds):
        unstable = _turns(source, process, float(speed), scan) != 0
        if not unstable.any():
            continue
        first = int(np.argmax(unstable))
        low, high = (scan[first - 1] if first else 0.0), scan[first]
        while high - low > 1e-6 * max_depth:
            inner = np.linspace(low, high, 10)[1:-1]
            bad = _turns(source, process, float(speed), inner) != 0
            high = inner[np.argmax(bad)] if bad.any() else high
            below = inner[inner < high]
            low = below[-1] if len(below) else low
        limits[k] = high
        chatter[k] = _crossing_frequency(source, process, float(speed), high)
    bifurcations = tuple("hopf" if np.isfinite(limit) else "none" for limit in limits)
    return StabilityLobes(speeds, limits, chatter, bifurcations, "nyquist", (*source.warnings, averaged(process)))


def _averaged_loop(process: MillingProcess, speed: float, receptance: Complex, frequencies: Real) -> Complex:
    """Loop gain per unit depth, (n_lines, 3, 3), 1/m, with every tooth's delay and process damping."""
    omega = 2j * np.pi * frequencies
    regained = 1 - np.exp(-omega[:, None] * np.array(process.pitches) / speed).mean(axis=1)
    loop = process.ktc * regained[:, None, None] * (average_directional_matrix(process) @ receptance)
    if process.process_damping:
        flank = process.process_damping / (speed * process.diameter / 2)
        normals = damping_harmonics(process, np.array([0]))[0].real
        loop = loop - (flank * omega)[:, None, None] * (normals @ receptance)
    return np.asarray(loop)


def _crossing_frequency(source: ToolReceptance, process: MillingProcess, speed: float, depth: float) -> float:
    """Frequency at which the determinant comes closest to zero, Hz."""
    fine = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in zip(source.grid, source.grid[1:], strict=False)]))
    loop = depth * _averaged_loop(process, speed, source.evaluate(fine), fine)
    return float(fine[np.argmin(np.abs(np.linalg.det(np.eye(3) - loop)))])
