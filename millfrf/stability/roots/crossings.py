"""All depths at which a Floquet multiplier crosses the unit circle."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, Real

from ..floquet.collocated_period import PeriodOperator
from ..milling_loop import DelaySystem

Spectrum = Callable[[Index, Real], Complex]
"""From speed indices and theta (n,) to eigenvalues (n, size) of the loop gain, largest first."""

SLOPE_STEP = 1e-6


@dataclass(frozen=True)
class Crossings:
    """Points at which multipliers cross the unit circle, one entry each, by speed and then by depth.

    Parameters
    ----------
    speed : (n,), int
        Index of the spindle speed.
    depth : (n,), m
        Axial depth of the crossing.
    theta : (n,), rad
        Argument of the multiplier, 0 <= theta <= pi; pi is period doubling, 0 a fold.
    outward : (n,), bool
        Whether the multiplier leaves the circle as depth grows.
    """

    speed: Index
    depth: Real
    theta: Real
    outward: NDArray[np.bool_]


def find_crossings(spectrum: Spectrum, grid: Real, max_depth: float, *, folds: bool = False) -> Crossings:
    """Follow the eigenvalues of the loop gain over theta and refine where one is real and positive.

    Intervals of the grid are halved until every eigenvalue that matters (above 0.7 / max_depth) has a clear partner
    at the other end. Along ``mu = exp(rho + i theta)`` the eigenvalue is analytic, so a multiplier leaves the circle
    with growing depth exactly where Im lambda falls with theta.

    Parameters
    ----------
    spectrum
        Eigenvalues of the loop gain.
    grid : (n_speeds, n_theta)
        First angles in (0, pi], increasing, ending in pi.
    max_depth
        Depths above it are not looked for, m.
    folds
        Look at theta = 0 too, where a purely regenerative force of equal teeth has none.
    """
    speed, low, high, value_low, value_high = _brackets(spectrum, grid, 0.7 / max_depth)
    theta, value, good = _roots(spectrum, speed, low, high, value_low, value_high)
    speed, theta, value = speed[good], theta[good], value[good]
    for end in (np.pi, 0.0) if folds else (np.pi,):
        there, at_end = _real_ones(spectrum, len(grid), end, 1 / max_depth)
        speed = np.concatenate([speed, there])
        theta, value = np.append(theta, np.full(len(there), end)), np.append(value, at_end)
    inside = value.real >= 1 / max_depth
    speed, theta, value = speed[inside], theta[inside], value[inside]
    slope = (value - nearest(spectrum(speed, theta - SLOPE_STEP), value)) / SLOPE_STEP
    depth = 1 / value.real
    order = np.lexsort([depth, speed])
    outward = slope.imag < 0
    return Crossings(speed[order], depth[order], theta[order], outward[order])


def nearest(values: Complex, wanted: Complex) -> Complex:
    """Give the value of each row that is nearest to the wanted one."""
    if not len(values):
        return np.zeros(0, dtype=complex)
    chosen = np.argmin(np.abs(values - wanted[:, None]), axis=1)
    return np.asarray(values[np.arange(len(values)), chosen])


def _real_ones(spectrum: Spectrum, n_speeds: int, theta: float, smallest: float) -> tuple[Index, Complex]:
    """Real positive eigenvalues at theta = pi or 0, where the loop gain is a real matrix."""
    values = spectrum(np.arange(n_speeds), np.full(n_speeds, theta))
    speeds, columns = np.nonzero((np.abs(values.imag) < 1e-9 * np.abs(values)) & (values.real >= smallest))
    return speeds, np.asarray(values[speeds, columns].real + 0j)


def _brackets(
    spectrum: Spectrum, grid: Real, smallest: float, *, halvings: int = 9
) -> tuple[Index, Real, Real, Complex, Complex]:
    """Intervals of theta with the pair of eigenvalues whose imaginary part changes sign in them."""
    n_speeds, count = grid.shape
    values = spectrum(np.repeat(np.arange(n_speeds), count), grid.ravel()).reshape(n_speeds, count, -1)
    speed = np.repeat(np.arange(n_speeds), count - 1)
    low, high = grid[:, :-1].ravel(), grid[:, 1:].ravel()
    size = values.shape[2]
    value_low, value_high = values[:, :-1].reshape(-1, size), values[:, 1:].reshape(-1, size)
    found = []
    for level in range(halvings + 1):
        clear = _clear(value_low, value_high, smallest) | (level == halvings)
        found.append(_sign_changes(speed, low, high, value_low, value_high, clear, smallest))
        speed, low, high = speed[~clear], low[~clear], high[~clear]
        value_low, value_high = value_low[~clear], value_high[~clear]
        if not len(speed):
            break
        middle = (low + high) / 2
        between = spectrum(speed, middle)
        speed = np.concatenate([speed, speed])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        value_low, value_high = np.concatenate([value_low, between]), np.concatenate([between, value_high])
    joined = tuple(np.concatenate(column) for column in zip(*found, strict=True))
    return joined  # type: ignore[return-value]


def _clear(one: Complex, other: Complex, smallest: float) -> NDArray[np.bool_]:
    """Whether each eigenvalue that matters has its own partner, close by."""
    matters_one, matters_other = np.abs(one) > smallest, np.abs(other) > smallest
    kept = max(int(matters_one.sum(axis=1).max(initial=0)), int(matters_other.sum(axis=1).max(initial=0)))
    kept = min(kept + 2, one.shape[1])
    distance = np.abs(one[:, :kept, None] - other[:, None, :kept])
    scale = np.maximum(np.abs(one[:, :kept, None]), np.abs(other[:, None, :kept]))
    return _each_close(distance, scale, matters_one[:, :kept]) & _each_close(
        distance.swapaxes(1, 2), scale.swapaxes(1, 2), matters_other[:, :kept]
    )


def _each_close(distance: Real, scale: Real, matters: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Say for each row whether every eigenvalue that matters moved little, and far less than to any other."""
    ordered = np.sort(distance, axis=2)
    closest = np.argmin(distance, axis=2)
    nearest_scale = np.take_along_axis(scale, closest[:, :, None], axis=2)[:, :, 0]
    good = ordered[:, :, 0] < 0.4 * nearest_scale
    if distance.shape[2] > 1:
        good &= ordered[:, :, 0] < 0.5 * ordered[:, :, 1]
    return np.asarray((good | ~matters).all(axis=1))


def _sign_changes(
    speed: Index,
    low: Real,
    high: Real,
    value_low: Complex,
    value_high: Complex,
    chosen: NDArray[np.bool_],
    smallest: float,
) -> tuple[Index, Real, Real, Complex, Complex]:
    rows = np.flatnonzero(chosen)
    kept = int((np.abs(value_low[rows]) > smallest).sum(axis=1).max(initial=0))
    one = value_low[rows, :kept]
    partner = np.argmin(np.abs(one[:, :, None] - value_high[rows][:, None, :]), axis=2)
    other = np.take_along_axis(value_high[rows], partner, axis=1)
    # at pi the imaginary part of a period doubling vanishes by itself; it is no Hopf crossing
    small = np.abs(other.imag) < 1e-9 * np.abs(other)
    ends_at_pi = (high[rows] > np.pi - 1e-12)[:, None] & small
    change = (one.imag * other.imag < 0) & ~ends_at_pi & (np.abs(one) > smallest) & ((one.real > 0) | (other.real > 0))
    i, j = np.nonzero(change)
    return speed[rows[i]], low[rows[i]], high[rows[i]], one[i, j], other[i, j]


def _roots(
    spectrum: Spectrum, speed: Index, low: Real, high: Real, value_low: Complex, value_high: Complex
) -> tuple[Real, Complex, NDArray[np.bool_]]:
    """Find where the imaginary part vanishes, for all brackets together by the Illinois rule."""
    low, high = low.copy(), high.copy()
    weight_low, weight_high = value_low.imag.copy(), value_high.imag.copy()
    first, width, rise = low.copy(), high - low, value_high - value_low
    theta, value = low.copy(), value_low.copy()
    live = np.arange(len(speed))
    for _ in range(40):
        if not len(live):
            break
        slope = weight_high[live] - weight_low[live]
        theta[live] = (low[live] * weight_high[live] - high[live] * weight_low[live]) / slope
        guess = value_low[live] + (theta[live] - first[live]) / width[live] * rise[live]
        value[live] = nearest(spectrum(speed[live], theta[live]), guess)
        other_side = value.imag[live] * weight_high[live] < 0
        low[live] = np.where(other_side, high[live], low[live])
        weight_low[live] = np.where(other_side, weight_high[live], weight_low[live] / 2)
        high[live], weight_high[live] = theta[live], value.imag[live]
        done = (np.abs(value.imag[live]) < 1e-10 * np.abs(value[live])) | (
            np.abs(high[live] - low[live]) < 1e-13 * np.pi
        )
        live = live[~done]
    good = (np.abs(value.imag) < 1e-6 * np.abs(value)) & (value.real > 0)
    return theta, value, good


def moved_depths(spectrum: Spectrum, found: Crossings) -> Real:
    """Estimate to first order how far another loop gain would move each depth, m.

    The root moves along the circle until the imaginary part vanishes again; at pi it stays where it is.

    Parameters
    ----------
    spectrum
        Function that gives the eigenvalues of the other loop gain: more nodes, fewer FRF lines ...
    found
        Crossings of the first loop gain.
    """
    if not len(found.depth):
        return np.zeros(0)
    before = (1 / found.depth).astype(np.complex128)
    there = nearest(spectrum(found.speed, found.theta), before)
    slope = (there - nearest(spectrum(found.speed, found.theta - SLOPE_STEP), there)) / SLOPE_STEP
    steep = np.where(
        (found.theta == np.pi) | (found.theta == 0), 0.0, slope.real / np.where(slope.imag == 0, np.inf, slope.imag)
    )
    change = there - before
    return np.asarray(found.depth**2 * (np.abs(change.real) + np.abs(change.imag * steep)))


def followed(spectrum: Spectrum, found: Crossings, *, steps: int = 3) -> Crossings:
    """Move crossings to where they lie for another loop gain that differs little, by Newton's steps along the circle.

    Parameters
    ----------
    spectrum
        Function that gives the eigenvalues of the other loop gain.
    found
        Crossings of the first loop gain.
    steps
        Number of steps of Newton's method.
    """
    if not len(found.depth):
        return found
    theta, value = found.theta.copy(), (1 / found.depth).astype(np.complex128)
    fixed = (theta == np.pi) | (theta == 0)
    for _ in range(1 if fixed.all() else steps):
        value = nearest(spectrum(found.speed, theta), value)
        slope = (value - nearest(spectrum(found.speed, theta - SLOPE_STEP), value)) / SLOPE_STEP
        step = np.where(fixed | (slope.imag == 0), 0.0, value.imag / np.where(slope.imag == 0, 1.0, slope.imag))
        step = np.clip(step, -0.05, 0.05)
        theta, value = theta - step, value - slope * step
    depth = np.where(value.real > 0, 1 / np.where(value.real > 0, value.real, 1.0), np.inf)
    return Crossings(found.speed, depth, np.clip(theta, 0.0, np.pi), found.outward)


STAGE = 4.0
"""Ratio of the depths at the end and at the beginning of a stage."""

ROW = 1.3
"""Largest ratio of the depths above and below a row of cells."""

GROWTH = 0.9
"""By how much the exponent of a period's growth rises at most in a row of cells."""


def safe_depth(system: DelaySystem) -> float:
    """Depth below which every cut is stable at every speed, by the small-gain theorem, m.

    ``2 a sup_t |D(t)| sup_w |H(i w)| < 1``: the loop of cutting force and structure gains less than it loses. Both
    suprema are looked up on fine grids, and half of the depth is taken.

    Parameters
    ----------
    system
        Structure and process; helix, pitch and process damping are not taken into account.
    """
    angles = np.linspace(0, 2 * np.pi / system.process.teeth, 241)
    force = np.linalg.norm(system.cutting_stiffness(angles), 2, axis=(1, 2)).max()
    natural, width = system.poles.imag, -system.poles.real
    near = natural[:, None] + width[:, None] * np.sinh(np.linspace(-4, 4, 33))
    omega = np.abs(np.concatenate([near.ravel(), np.linspace(0, 1.5 * np.abs(system.poles).max(), 129)]))
    motion = 0.5 / float(force * receptance_size(system, omega).max())
    return float(motion / 2)


def receptance_size(system: DelaySystem, omega: Real) -> Real:
    """Largest singular value of the tool's receptance at frequencies (n,) in rad/s, m/N."""
    direct = 1 / (1j * omega[:, None] - system.poles)
    mirrored = 1 / (1j * omega[:, None] - system.poles.conj())
    values = np.einsum("wr,rp,rq->wpq", direct, system.right, system.left)
    values += np.einsum("wr,rp,rq->wpq", mirrored, system.right.conj(), system.left.conj())
    return np.asarray(np.linalg.norm(values + system.upper, 2, axis=(1, 2)))


def stages(first: float, max_depth: float) -> list[tuple[float, float]]:
    """Bottom and top of each stage, m; they are the same for every largest depth, which ends the last of them.

    Examples
    --------
    >>> stages(1e-4, 1e-3)
    [(0.0001, 0.0004), (0.0004, 0.001)]
    """
    bottoms = first * STAGE ** np.arange(max(1, int(np.ceil(np.log(max_depth / first) / np.log(STAGE)))))
    return [(float(bottom), float(max(min(bottom * STAGE, max_depth), 1.01 * bottom))) for bottom in bottoms]


def row_edges(bottom: float, top: float, growth: float) -> Real:
    """Give edges of the rows of cells between two depths (m): geometric, and finer where solutions grow fast.

    Parameters
    ----------
    bottom, top : m
        Depths between which the rows lie.
    growth
        Exponent by which solutions grow over a period at ``top``, at most; it rises with the root of depth.

    Returns
    -------
    (n_rows + 1,), m
    """
    depths = np.geomspace(bottom, top, 200)
    measure = np.log(depths / bottom) / np.log(ROW) + growth * (np.sqrt(depths / top) - np.sqrt(bottom / top)) / GROWTH
    count = max(1, int(np.ceil(measure[-1])))
    edges = np.interp(np.linspace(0, measure[-1], count + 1), measure, depths)
    edges[0], edges[-1] = bottom, top
    return np.asarray(edges)


def transition(operator: PeriodOperator, speeds: NDArray[np.int64], b: Complex) -> tuple[Complex, Complex]:
    """M(b) over a period and dM/db at pairs of speed index and b (m), each shape (n_pairs, n, n).

    ``M = Phi + b S (I - b G)^-1 E`` and ``dM/db = S (I - b G)^-2 E``.
    """
    n_nodes = operator.within.shape[-1]
    factor = b[:, None, None]
    inverse = np.linalg.inv(np.eye(n_nodes) - factor * operator.within[speeds])
    after = inverse @ operator.motion[speeds]
    before = operator.impulse[speeds] @ inverse
    return operator.free[speeds] + factor * (operator.impulse[speeds] @ after), before @ after


def polished(operator: PeriodOperator, found: Crossings, *, steps: int = 3) -> tuple[Crossings, NDArray[np.bool_]]:
    """Move crossings to where they lie for this operator.

    The eigenvalue of M(a (1 - 1/mu)) nearest mu is made equal to ``mu = exp(i theta)`` by Newton steps in (theta, a);
    at theta = pi everything is real and only the depth moves.

    Returns
    -------
    crossings
    settled : (n,), bool
        False where the steps did not settle near the beginning.
    """
    theta, depth = found.theta.copy(), found.depth.copy()
    at_pi = found.theta == np.pi
    last = np.zeros(len(depth))
    for _ in range(steps if len(depth) else 0):
        multiplier = np.exp(1j * theta)
        factor = 1 - 1 / multiplier
        matrix, slope = transition(operator, found.speed, depth * factor)
        values, vectors = np.linalg.eig(matrix)
        chosen = np.argmin(np.abs(values - multiplier[:, None]), axis=1)
        rows = np.arange(len(chosen))
        left = np.linalg.inv(vectors)[rows, chosen]
        by_b = np.einsum("ci,cij,cj->c", left, slope, vectors[rows, :, chosen])
        gap = values[rows, chosen] - multiplier
        by_depth = by_b * factor
        by_theta = 1j * (by_b * depth / multiplier - multiplier)
        determinant = by_theta.real * by_depth.imag - by_theta.imag * by_depth.real
        safe = np.where(determinant == 0, 1.0, determinant)
        theta_step = (gap.real * by_depth.imag - gap.imag * by_depth.real) / safe
        depth_step = (by_theta.real * gap.imag - by_theta.imag * gap.real) / safe
        theta = np.where(at_pi, np.pi, theta - theta_step)
        last = np.where(at_pi, (gap / np.where(by_depth == 0, 1.0, by_depth)).real, depth_step)
        depth = depth - last
    near = (np.abs(theta - found.theta) < 0.1) & (np.abs(depth - found.depth) < 0.1 * found.depth)
    return Crossings(found.speed, depth, theta, found.outward), near & (np.abs(last) < 1e-6 * found.depth)
