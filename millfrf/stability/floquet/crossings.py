"""All depths at which a Floquet multiplier crosses the unit circle."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Index, Real

from ..milling_loop import DelaySystem
from .collocated_period import PeriodOperator

# from speed indices and theta (n,) to eigenvalues (n, size) of the loop gain, largest first
Spectrum = Callable[[Index, Real], Complex]

SLOPE_STEP = 1e-6  # rad; of the difference quotient over theta


@dataclass(frozen=True)
class Crossings:
    """Points at which multipliers cross the unit circle, one entry each, by speed and then by depth."""

    speed: Index  # (n,): index of the spindle speed
    depth: Real  # (n,), m: axial depth of the crossing
    theta: Real  # (n,), rad: argument of the multiplier, 0 <= theta <= pi; pi is period doubling, 0 a fold
    outward: NDArray[np.bool_]  # (n,): whether the multiplier leaves the circle as depth grows

    def select(self, rows: NDArray[np.bool_] | Index) -> "Crossings":
        """Select some crossings by a mask or by indices."""
        return Crossings(self.speed[rows], self.depth[rows], self.theta[rows], self.outward[rows])


def find_crossings(spectrum: Spectrum, grid: Real, max_depth: float, *, folds: bool = False) -> Crossings:
    """Follow the eigenvalues of the loop gain over theta and refine where one is real and positive.

    Intervals of the grid (n_speeds, n_theta), increasing angles in (0, pi] that end in pi, are halved until every
    relevant eigenvalue (above 0.7 / max_depth, 1/m) has a unique partner at the other end. Along
    ``mu = exp(rho + i theta)`` the eigenvalue is analytic, so a multiplier leaves the circle with growing depth exactly
    where Im lambda falls with theta. With ``folds`` theta = 0 is searched too; a purely regenerative force of equal
    teeth has no crossings there.
    """
    speed, low, high, value_low, value_high = _brackets(spectrum, grid, 0.7 / max_depth)
    theta, value, good = _roots(spectrum, speed, low, high, value_low, value_high)
    speed, theta, value = speed[good], theta[good], value[good]
    for end in (np.pi, 0.0) if folds else (np.pi,):
        end_speed, end_value = _real_positive(spectrum, len(grid), end, 1 / max_depth)
        speed = np.concatenate([speed, end_speed])
        theta, value = np.append(theta, np.full(len(end_speed), end)), np.append(value, end_value)
    inside = value.real >= 1 / max_depth
    speed, theta, value = speed[inside], theta[inside], value[inside]
    slope = (value - nearest(spectrum(speed, theta - SLOPE_STEP), value)) / SLOPE_STEP
    depth = 1 / value.real
    order = np.lexsort([depth, speed])
    outward = slope.imag < 0
    return Crossings(speed[order], depth[order], theta[order], outward[order])


def nearest(values: Complex, guesses: Complex) -> Complex:
    """Select from each row of ``values`` (n, size) the value nearest to the guess (n,) of this row."""
    if not len(values):
        return np.zeros(0, dtype=complex)
    chosen = np.argmin(np.abs(values - guesses[:, None]), axis=1)
    return np.asarray(values[np.arange(len(values)), chosen])


def _real_positive(spectrum: Spectrum, n_speeds: int, theta: float, smallest: float) -> tuple[Index, Complex]:
    """Find the real positive eigenvalues at theta = pi or 0, where the loop gain is a real matrix."""
    values = spectrum(np.arange(n_speeds), np.full(n_speeds, theta))
    speeds, columns = np.nonzero((np.abs(values.imag) < 1e-9 * np.abs(values)) & (values.real >= smallest))
    return speeds, np.asarray(values[speeds, columns].real + 0j)


def _brackets(
    spectrum: Spectrum, grid: Real, smallest: float, *, halvings: int = 9
) -> tuple[Index, Real, Real, Complex, Complex]:
    """Find intervals of theta in which the imaginary part of an eigenvalue changes its sign.

    Return speed index, both ends, and the eigenvalue at both ends.
    """
    n_speeds, count = grid.shape
    values = spectrum(np.repeat(np.arange(n_speeds), count), grid.ravel()).reshape(n_speeds, count, -1)
    speed = np.repeat(np.arange(n_speeds), count - 1)
    low, high = grid[:, :-1].ravel(), grid[:, 1:].ravel()
    size = values.shape[2]
    value_low, value_high = values[:, :-1].reshape(-1, size), values[:, 1:].reshape(-1, size)
    brackets = []
    for level in range(halvings + 1):
        clear = _clear(value_low, value_high, smallest) | (level == halvings)
        brackets.append(_sign_changes(speed, low, high, value_low, value_high, clear, smallest))
        speed, low, high = speed[~clear], low[~clear], high[~clear]
        value_low, value_high = value_low[~clear], value_high[~clear]
        if not len(speed):
            break
        middle = (low + high) / 2
        between = spectrum(speed, middle)
        speed = np.concatenate([speed, speed])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        value_low, value_high = np.concatenate([value_low, between]), np.concatenate([between, value_high])
    joined = tuple(np.concatenate(column) for column in zip(*brackets, strict=True))
    return joined  # type: ignore[return-value]


def _clear(low: Complex, high: Complex, smallest: float) -> NDArray[np.bool_]:
    """Check whether each relevant eigenvalue at one end of an interval has a unique close partner at the other end."""
    relevant_low, relevant_high = np.abs(low) > smallest, np.abs(high) > smallest
    count = max(int(relevant_low.sum(axis=1).max(initial=0)), int(relevant_high.sum(axis=1).max(initial=0)))
    count = min(count + 2, low.shape[1])
    distance = np.abs(low[:, :count, None] - high[:, None, :count])
    scale = np.maximum(np.abs(low[:, :count, None]), np.abs(high[:, None, :count]))
    return _each_close(distance, scale, relevant_low[:, :count]) & _each_close(
        distance.swapaxes(1, 2), scale.swapaxes(1, 2), relevant_high[:, :count]
    )


def _each_close(distance: Real, scale: Real, relevant: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Check whether every relevant eigenvalue of a row is close to one partner and far from all other partners."""
    ordered = np.sort(distance, axis=2)
    closest = np.argmin(distance, axis=2)
    nearest_scale = np.take_along_axis(scale, closest[:, :, None], axis=2)[:, :, 0]
    good = ordered[:, :, 0] < 0.4 * nearest_scale
    if distance.shape[2] > 1:
        good &= ordered[:, :, 0] < 0.5 * ordered[:, :, 1]
    return np.asarray((good | ~relevant).all(axis=1))


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
    count = int((np.abs(value_low[rows]) > smallest).sum(axis=1).max(initial=0))
    first = value_low[rows, :count]
    partner = np.argmin(np.abs(first[:, :, None] - value_high[rows][:, None, :]), axis=2)
    second = np.take_along_axis(value_high[rows], partner, axis=1)
    # at pi the imaginary part of a period doubling vanishes by itself; it is no Hopf crossing
    ends_at_pi = (high[rows] > np.pi - 1e-12)[:, None] & (np.abs(second.imag) < 1e-9 * np.abs(second))
    positive = (first.real > 0) | (second.real > 0)
    change = (first.imag * second.imag < 0) & ~ends_at_pi & (np.abs(first) > smallest) & positive
    i, j = np.nonzero(change)
    return speed[rows[i]], low[rows[i]], high[rows[i]], first[i, j], second[i, j]


def _roots(
    spectrum: Spectrum, speed: Index, low: Real, high: Real, value_low: Complex, value_high: Complex
) -> tuple[Real, Complex, NDArray[np.bool_]]:
    """Find theta and eigenvalue where the imaginary part vanishes, in all brackets together, by the Illinois rule."""
    low, high = low.copy(), high.copy()
    weight_low, weight_high = value_low.imag.copy(), value_high.imag.copy()
    first, width, rise = low.copy(), high - low, value_high - value_low
    theta, value = low.copy(), value_low.copy()
    live = np.arange(len(speed))  # brackets that have not converged
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


def moved_depths(spectrum: Spectrum, crossings: Crossings) -> Real:
    """Compute the first-order change of each depth (m) if another loop gain is used, for example with more nodes.

    The root moves along the circle until the imaginary part vanishes again; at pi its angle is fixed.
    """
    if not len(crossings.depth):
        return np.zeros(0)
    before = (1 / crossings.depth).astype(np.complex128)
    after = nearest(spectrum(crossings.speed, crossings.theta), before)
    slope = (after - nearest(spectrum(crossings.speed, crossings.theta - SLOPE_STEP), after)) / SLOPE_STEP
    steep = np.where(
        (crossings.theta == np.pi) | (crossings.theta == 0),
        0.0,
        slope.real / np.where(slope.imag == 0, np.inf, slope.imag),
    )
    change = after - before
    return np.asarray(crossings.depth**2 * (np.abs(change.real) + np.abs(change.imag * steep)))


def followed(spectrum: Spectrum, crossings: Crossings) -> Crossings:
    """Follow crossings to a slightly different loop gain by three Newton steps along the unit circle."""
    if not len(crossings.depth):
        return crossings
    theta, value = crossings.theta.copy(), (1 / crossings.depth).astype(np.complex128)
    fixed = (theta == np.pi) | (theta == 0)
    for _ in range(1 if fixed.all() else 3):
        value = nearest(spectrum(crossings.speed, theta), value)
        slope = (value - nearest(spectrum(crossings.speed, theta - SLOPE_STEP), value)) / SLOPE_STEP
        step = np.where(fixed | (slope.imag == 0), 0.0, value.imag / np.where(slope.imag == 0, 1.0, slope.imag))
        step = np.clip(step, -0.05, 0.05)
        theta, value = theta - step, value - slope * step
    depth = np.where(value.real > 0, 1 / np.where(value.real > 0, value.real, 1.0), np.inf)
    return Crossings(crossings.speed, depth, np.clip(theta, 0.0, np.pi), crossings.outward)


def safe_depth(system: DelaySystem) -> float:
    """Compute the depth (m) below which every cut is stable at every speed by the small-gain theorem.

    Below it ``2 a sup_t |D(t)| sup_w |H(i w)| < 1``: the loop of cutting force and structure has a gain below 1. Helix,
    pitch and process damping are ignored.
    """
    angles = np.linspace(0, 2 * np.pi / system.process.teeth, 241)
    force = np.linalg.norm(system.cutting_stiffness(angles), 2, axis=(1, 2)).max()
    motion = 0.5 / float(force * largest_receptance(system))
    return float(motion / 2)  # half, as both suprema are taken on grids


def largest_receptance(system: DelaySystem, motions: tuple[int, ...] = (0, 1, 2)) -> float:
    """Compute the largest singular value of the tool's receptance, m/N, on a grid of frequencies.

    Only the motions in some of the directions X, Y and Z (0, 1, 2) count.
    """
    natural, width = system.poles.imag, -system.poles.real
    near = natural[:, None] + width[:, None] * np.sinh(np.linspace(-4, 4, 33))
    omega = np.abs(np.concatenate([near.ravel(), np.linspace(0, 1.5 * np.abs(system.poles).max(), 129)]))
    return float(np.linalg.norm(system.receptance(omega)[:, motions], 2, axis=(1, 2)).max())


def stages(first: float, max_depth: float) -> list[tuple[float, float]]:
    """Return bottom and top of each stage of depths, m; the top is four times the bottom, at most ``max_depth``.

    Examples
    --------
    >>> stages(1e-4, 1e-3)
    [(0.0001, 0.0004), (0.0004, 0.001)]
    """
    bottoms = first * 4.0 ** np.arange(max(1, int(np.ceil(np.log(max_depth / first) / np.log(4.0)))))
    return [(float(bottom), float(max(min(bottom * 4.0, max_depth), 1.01 * bottom))) for bottom in bottoms]


def row_edges(bottom: float, top: float, growth: float) -> Real:
    """Divide the range between two depths into rows of cells; return the edges of the rows, (n_rows + 1,), m.

    From one edge to the next the depth rises by a factor of at most 1.3, and the exponent by which solutions grow over
    a period by at most 0.9. ``growth`` bounds this exponent at ``top``; it is proportional to the root of the depth.
    """
    depths = np.geomspace(bottom, top, 200)
    measure = np.log(depths / bottom) / np.log(1.3) + growth * (np.sqrt(depths / top) - np.sqrt(bottom / top)) / 0.9
    count = max(1, int(np.ceil(measure[-1])))
    edges = np.interp(np.linspace(0, measure[-1], count + 1), measure, depths)
    edges[0], edges[-1] = bottom, top
    return np.asarray(edges)


def transition(operator: PeriodOperator, speeds: Index, b: Complex) -> tuple[Complex, Complex]:
    """Compute M(b) over a period and dM/db at pairs of speed index and b (m), each (n_pairs, n, n).

    ``M = Phi + b S (I - b G)^-1 E`` and ``dM/db = S (I - b G)^-2 E``.
    """
    n_nodes = operator.within.shape[-1]
    factor = b[:, None, None]
    inverse = np.linalg.inv(np.eye(n_nodes) - factor * operator.within[speeds])
    after = inverse @ operator.motion[speeds]
    before = operator.impulse[speeds] @ inverse
    return operator.free[speeds] + factor * (operator.impulse[speeds] @ after), before @ after


def polished(operator: PeriodOperator, crossings: Crossings) -> tuple[Crossings, NDArray[np.bool_]]:
    """Refine crossings for a slightly different operator; also return whether each converged near its start.

    Three Newton steps in (theta, a) make the eigenvalue of M(a (1 - 1/mu)) nearest mu equal to ``mu = exp(i theta)``;
    at theta = pi all values are real and only the depth changes.
    """
    theta, depth = crossings.theta.copy(), crossings.depth.copy()
    at_pi = crossings.theta == np.pi
    last, near = np.zeros(len(depth)), np.ones(len(depth), dtype=bool)
    for _ in range(3 if len(depth) else 0):
        multiplier = np.exp(1j * theta)
        factor = 1 - 1 / multiplier
        matrix, slope = transition(operator, crossings.speed, depth * factor)
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
        near &= (np.abs(theta - crossings.theta) < 0.1) & (np.abs(depth - crossings.depth) < 0.1 * crossings.depth)
        # a step far from its start does not converge, and may end where the collocation is singular
        theta, depth = np.where(near, theta, crossings.theta), np.where(near, depth, crossings.depth)
    return Crossings(crossings.speed, depth, theta, crossings.outward), near & (np.abs(last) < 1e-6 * crossings.depth)
