"""Zero-order solution with the averaged directional matrix, and Nyquist's criterion on it."""

from dataclasses import astuple, dataclass

import numpy as np

from estimation import Frf
from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import MillingProcess, average_directional_matrix, damping_harmonics, refuse_varied
from modal_fit import ModalModel

from ..lobes_result import StabilityLobes
from ..tip_receptance import ToolReceptance, reaching, tool_receptance


def zero_order(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Compute the depth limit at each speed from ``det[I - a K_tc alpha_0 (1 - exp(-i w tau)) H(w)] = 0``.

    With an eigenvalue lambda(w) of ``alpha_0 H``, the depth is ``1 / (K_tc lambda (1 - exp(-i w tau)))`` at frequencies
    where this number is real and positive. Roots of the imaginary part are bracketed on every continuous branch of
    eigenvalues and refined on the structure itself, so no grid error remains for a modal model (Budak & Altintas 1998;
    Mohammadi & Ahmadi, Eq. 5). A modal model is evaluated up to the frequency above which the loop gain is too small
    for every depth up to ``max_depth``. Averaged coefficients cannot show period doubling; a warning says so.

    Parameters
    ----------
    structure
        Receptance at the tip, measured or modal.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        Speeds or depth that are not positive, or a structure that cannot be used.
    """
    refuse_varied(process, "the zero-order solution", "use collocation", takes=("turning", "helix"))
    speeds = checked_speeds(spindle_speeds, max_depth)
    alpha = process.ktc * average_directional_matrix(process)
    source = reaching(tool_receptance(structure), alpha, max_depth)
    limits = np.full(len(speeds), np.inf)
    chatter = np.full(len(speeds), np.nan)
    grid = source.grid
    branches = _branches(alpha @ source.evaluate(grid))
    candidates = [_candidates(grid, branches, 2 * np.pi / (process.teeth * speed), max_depth) for speed in speeds]
    # the brackets of all speeds are refined together
    owner = np.repeat(np.arange(len(speeds)), [len(brackets.low) for brackets in candidates])
    if len(owner):
        delays = 2 * np.pi / (process.teeth * speeds[owner])
        joined = Candidates(*(np.concatenate(column) for column in zip(*map(astuple, candidates), strict=True)))
        depths, frequencies = _refine(source, alpha, joined, delays)
        for index in np.argsort(-depths):  # the lowest is written last
            if depths[index] <= max_depth:
                limits[owner[index]], chatter[owner[index]] = depths[index], frequencies[index]
    bifurcations = tuple("hopf" if np.isfinite(limit) else "none" for limit in limits)
    return StabilityLobes(
        speeds, limits, chatter, bifurcations, "zero-order", (*source.warnings, *_averaging_warning(process))
    )


def _averaging_warning(process: MillingProcess) -> tuple[str, ...]:
    if process.is_turning:  # its coefficients are constant
        return ()
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * np.pi)
    return (
        "cutting coefficients are averaged over the tooth period: period doubling is not seen, and where teeth cut for "
        f"a part of the time (here {min(share, 1):.0%}) or period doublings are at small depths the limits can be "
        "several times too high; plan no cut on them",
    )


def checked_speeds(spindle_speeds: Real, max_depth: float) -> Real:
    """Return the speeds as an array; refuse speeds or a depth that are not positive."""
    speeds = np.atleast_1d(np.asarray(spindle_speeds, dtype=float))
    if speeds.size == 0 or not (np.isfinite(speeds).all() and speeds.min() > 0):
        raise InputError(f"spindle speeds must be positive, got {speeds.min() if speeds.size else 'none'} rad/s")
    if not (np.isfinite(max_depth) and max_depth > 0):
        raise InputError(f"largest depth {max_depth!r} m must be positive")
    return speeds


def _branches(matrices: Complex) -> Complex:
    """Compute eigenvalues (n_lines, 3), sorted so that each column is continuous in frequency."""
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
    """Find brackets in which a branch's loop gain becomes real and positive, for the lowest depths only."""
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
    """Add lines so that the phase of the delay changes by less than a twelfth of a turn between two of them."""
    counts = np.maximum(1, np.ceil(np.diff(grid) * 12 * delay)).astype(int)
    if counts.max() == 1:
        return grid, branches
    starts = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[starts]
    fine = np.append(grid[starts] + share * np.diff(grid)[starts], grid[-1])
    values = branches[starts] + share[:, None] * np.diff(branches, axis=0)[starts]
    return fine, np.concatenate([values, branches[-1:]])


def _refine(source: ToolReceptance, alpha: Real, brackets: Candidates, delays: Real) -> tuple[Real, Real]:
    """Refine all brackets together by the Illinois rule; return depths (infinite: no limit) and frequencies (Hz)."""
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


def unstable_pole_pairs(source: ToolReceptance, process: MillingProcess, speed: float, depths: Real) -> Index:
    """Count the unstable closed-loop pole pairs at each depth, (n_depths,), by encirclements of the origin.

    ``det[I - a K_tc alpha_0 mean_j(1 - exp(-s tau_j)) H(s)]`` is evaluated along the positive imaginary axis; process
    damping adds ``a s (C / V) P_0 H``. The structure without a cut is stable, so that each turn of the argument by
    -2 pi is one unstable pair (Nyquist 1932; Mohammadi & Ahmadi, Eq. 5). Outside the known span the determinant is
    assumed to stay near its value at the end of the span.
    """
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
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Compute the lowest unstable depth at each speed by counting encirclements and bisection.

    Depths are scanned in 60 steps, so that an unstable island thinner than a step may be missed; the limit is then
    refined to 1e-6 of the largest depth. A measured FRF is used without a fit.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As for :func:`zero_order`.

    Raises
    ------
    InputError
        As :func:`zero_order`.
    """
    refuse_varied(process, "the Nyquist criterion", "use collocation", takes=("turning", "helix", "pitch", "damping"))
    speeds = checked_speeds(spindle_speeds, max_depth)
    source = reaching(tool_receptance(structure), process.ktc * average_directional_matrix(process), max_depth)
    limits = np.full(len(speeds), np.inf)
    chatter = np.full(len(speeds), np.nan)
    scan = np.linspace(max_depth / 60, max_depth, 60)
    for k, speed in enumerate(speeds):
        unstable = unstable_pole_pairs(source, process, float(speed), scan) != 0
        if not unstable.any():
            continue
        first = int(np.argmax(unstable))
        low, high = (scan[first - 1] if first else 0.0), scan[first]
        while high - low > 1e-6 * max_depth:
            inner = np.linspace(low, high, 10)[1:-1]
            above = unstable_pole_pairs(source, process, float(speed), inner) != 0
            high = inner[np.argmax(above)] if above.any() else high
            below = inner[inner < high]
            low = below[-1] if len(below) else low
        limits[k] = high
        chatter[k] = _crossing_frequency(source, process, float(speed), high)
    bifurcations = tuple("hopf" if np.isfinite(limit) else "none" for limit in limits)
    return StabilityLobes(
        speeds, limits, chatter, bifurcations, "nyquist", (*source.warnings, *_averaging_warning(process))
    )


def _averaged_loop(process: MillingProcess, speed: float, receptance: Complex, frequencies: Real) -> Complex:
    """Compute the loop gain per depth, (n_lines, 3, 3), 1/m, with the delay of each tooth and process damping."""
    omega = 2j * np.pi * frequencies
    regenerated = 1 - np.exp(-omega[:, None] * np.array(process.pitches) / speed).mean(axis=1)
    loop = process.ktc * regenerated[:, None, None] * (average_directional_matrix(process) @ receptance)
    if process.process_damping:
        flank = process.process_damping / (speed * process.diameter / 2)
        normals = damping_harmonics(process, np.array([0]))[0].real
        loop = loop - (flank * omega)[:, None, None] * (normals @ receptance)
    return np.asarray(loop)


def _crossing_frequency(source: ToolReceptance, process: MillingProcess, speed: float, depth: float) -> float:
    """Find the frequency (Hz) at which the modulus of the determinant is smallest."""
    fine = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in zip(source.grid, source.grid[1:], strict=False)]))
    loop = depth * _averaged_loop(process, speed, source.evaluate(fine), fine)
    return float(fine[np.argmin(np.abs(np.linalg.det(np.eye(3) - loop)))])
