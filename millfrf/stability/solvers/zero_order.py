"""Zero-order solution with the averaged directional matrix, and Nyquist's criterion on it."""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, average_directional_matrix, damping_harmonics, refuse_varied
from modal_fit import ModalModel

from ..lobes_result import StabilityLobes
from ..tip_receptance import ToolReceptance, reaching, tool_receptance


def zero_order(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Give the depth limit at each speed from ``det[I - a K_tc alpha_0 (1 - exp(-i w tau)) H(w)] = 0``.

    With an eigenvalue lambda(w) of ``alpha_0 H``, the depth is ``1 / (K_tc lambda (1 - exp(-i w tau)))`` where that is
    real and positive. Roots of its imaginary part are bracketed on every continuous branch of eigenvalues and refined
    on the structure itself, so no grid error remains for a modal model (Budak & Altintas 1998; Mohammadi & Ahmadi,
    Eq. 5). A modal model is followed up to where the loop's gain is too small for any depth asked for. Averaged
    coefficients cannot show period doubling; the warnings say so.

    Parameters
    ----------
    structure
        Receptance at the tip, measured or modal.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        Speeds or depth that are not positive, or a structure that cannot be used.
    """
    refuse_varied(process, "the zero-order solution", "use nyquist or collocation", takes=("helix",))
    speeds = checked_speeds(spindle_speeds, max_depth)
    alpha = process.ktc * average_directional_matrix(process)
    source = reaching(tool_receptance(structure), alpha, max_depth)
    limits = np.full(len(speeds), np.inf)
    chatter = np.full(len(speeds), np.nan)
    grid = source.grid
    branches = _branches(alpha @ source.evaluate(grid))
    candidates = [_candidates(grid, branches, 2 * np.pi / (process.teeth * speed), max_depth) for speed in speeds]
    owner = np.repeat(np.arange(len(speeds)), [len(found.low) for found in candidates])
    if len(owner):
        delays = 2 * np.pi / (process.teeth * speeds[owner])
        joined = Candidates(*(np.concatenate(column) for column in zip(*map(astuple, candidates), strict=True)))
        depths, frequencies = _refine(source, alpha, joined, delays)
        for index in np.argsort(-depths):  # the lowest is written last
            if depths[index] <= max_depth:
                limits[owner[index]], chatter[owner[index]] = depths[index], frequencies[index]
    bifurcations = tuple("hopf" if np.isfinite(limit) else "none" for limit in limits)
    return StabilityLobes(speeds, limits, chatter, bifurcations, "zero-order", (*source.warnings, averaged(process)))


def averaged(process: MillingProcess) -> str:
    """Write the warning that averaged coefficients cannot show period doubling."""
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * np.pi)
    return (
        "cutting coefficients are averaged over the tooth period: period doubling is not seen, and where teeth cut for "
        f"a part of the time (here {min(share, 1):.0%}) or doublings lie low the limits can be several times too high; "
        "plan no cut on them"
    )


def checked_speeds(spindle_speeds: Real, max_depth: float) -> Real:
    """Speeds as an array, refused where not positive.

    Raises
    ------
    InputError
        With the value.
    """
    speeds = np.atleast_1d(np.asarray(spindle_speeds, dtype=float))
    if speeds.size == 0 or not (np.isfinite(speeds).all() and speeds.min() > 0):
        raise InputError(f"spindle speeds must be positive, got {speeds.min() if speeds.size else 'none'} rad/s")
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive")
    return speeds


def _branches(matrices: Complex) -> Complex:
    """Eigenvalues (n_lines, 3), each column continuous in frequency."""
    values = np.asarray(np.linalg.eigvals(matrices), dtype=np.complex128)
    orders = np.array([[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]])
    for k in range(1, len(values)):
        guess = values[k - 1] if k == 1 else 2 * values[k - 1] - values[k - 2]
        values[k] = values[k][orders[np.argmin(np.abs(values[k][orders] - guess).sum(axis=1))]]
    return np.asarray(values)


@dataclass(frozen=True)
class Candidates:
    """Brackets of possible limits: frequencies (Hz) and branch eigenvalues at both ends, each (n_candidates,)."""

    low: Real
    high: Real
    value_low: Complex
    value_high: Complex


def _candidates(grid: Real, branches: Complex, delay: float, max_depth: float) -> Candidates:
    """Brackets in which a branch's loop gain is real and positive, the lowest depths only."""
    fine, values = _refined_for(grid, branches, delay)
    loop = values * (1 - np.exp(-2j * np.pi * fine * delay))[:, None]
    crossing = (loop.imag[:-1] * loop.imag[1:] < 0) & ((loop.real[:-1] > 0) | (loop.real[1:] > 0))
    lines, columns = np.nonzero(crossing)
    before, after = loop[lines, columns], loop[lines + 1, columns]
    gain = before.real + before.imag / (before.imag - after.imag) * (after.real - before.real)
    near = gain > max(gain.max(initial=0.0) / 1.25, 1 / (1.25 * max_depth))
    lines, columns = lines[near], columns[near]
    return Candidates(fine[lines], fine[lines + 1], values[lines, columns], values[lines + 1, columns])


def _refined_for(grid: Real, branches: Complex, delay: float) -> tuple[Real, Complex]:
    """Add lines so that the delay turns by less than a twelfth of a turn between two of them."""
    counts = np.maximum(1, np.ceil(np.diff(grid) * 12 * delay)).astype(int)
    if counts.max() == 1:
        return grid, branches
    starts = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[starts]
    fine = np.append(grid[starts] + share * np.diff(grid)[starts], grid[-1])
    values = branches[starts] + share[:, None] * np.diff(branches, axis=0)[starts]
    return fine, np.concatenate([values, branches[-1:]])


def _refine(source: ToolReceptance, alpha: Real, brackets: Candidates, delays: Real) -> tuple[Real, Real]:
    """Depths (inf where there is none) and frequencies; all brackets shrink together by the Illinois rule."""
    low, high = brackets.low.copy(), brackets.high.copy()
    width = brackets.high - brackets.low

    def loop(frequencies: Real) -> Complex:
        share = (frequencies - brackets.low) / width
        guess = brackets.value_low + share * (brackets.value_high - brackets.value_low)
        values = np.linalg.eigvals(alpha @ source.evaluate(frequencies))
        nearest = np.argmin(np.abs(values - guess[:, None]), axis=1)
        chosen = values[np.arange(len(values)), nearest]
        return np.asarray(chosen * (1 - np.exp(-2j * np.pi * frequencies * delays)))

    weight_low, weight_high = loop(low).imag, loop(high).imag
    bracketed = weight_low * weight_high < 0
    value, middle = np.ones(len(low), dtype=complex), low
    for _ in range(40):
        slope = np.where(weight_high == weight_low, 1.0, weight_high - weight_low)
        middle = np.where(bracketed, (low * weight_high - high * weight_low) / slope, low)
        value = loop(middle)
        if np.all(~bracketed | (np.abs(value.imag) < 1e-11 * np.abs(value)) | (np.abs(high - low) < 1e-11 * high)):
            break
        other_side = value.imag * weight_high < 0
        low = np.where(other_side, high, low)
        weight_low = np.where(other_side, weight_high, weight_low / 2)
        high, weight_high = middle, value.imag
    usable = bracketed & (value.real > 0)
    return np.where(usable, 1 / np.where(usable, value.real, 1.0), np.inf), middle


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
