"""Zero-order solution: the averaged directional matrix on the full FRF matrix, exact at every speed."""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, average_directional_matrix, refuse_varied
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from ..lobes import StabilityLobes
from ..milling_loop import ToolReceptance, reaching, tool_receptance

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
