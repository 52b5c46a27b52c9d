"""The trial's two judges: Floquet multipliers of the true cut, and its simulation in time with teeth that leave it.

A small deviation of the chips, w(t) = u(t) - u(t - T) with u the motion of each tooth in the cut along its radius,
drives every mode by the force ``depth ktc g(t) w(t)``. Within an element of time w is a polynomial through Gauss's
nodes, and each mode answers it exactly; so the map of a period acts on the modes and on the chips of the last period.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi

import numpy as np

from .in_time import mill
from .robot_cell import Complex, Cut, Real, Structure

NODES = 6  # nodes of an element
LONGEST = 1.2  # rad; longest element, as an angle of the fastest mode
WIDEST = 0.45  # rad; widest element, as an angle of the cutter
LADDER = 1.25  # ratio of the depths at which stability is tried
STEPS = 60  # fewest steps of a simulated tooth period
SETTLED = 0.1  # deviation over feed from which a simulated cut is no steady cut


@dataclass(frozen=True)
class PeriodMap:
    """Map of one tooth period at a speed, for any depth a: modes s and chips u of a period, from those of the last.

    ``u = O s + a G (u - u_last)`` and ``s_end = P s + a R (u - u_last)``.
    """

    output: Real
    gains: Real
    decay: Real
    driven: Real

    def radii(self, depths: Real) -> Real:
        """Largest modulus of the multipliers at each depth."""
        n, m = len(self.decay), len(self.output)
        a = np.asarray(depths, dtype=float)[:, None, None]
        from_chips = -a * self.gains
        from_modes = np.broadcast_to(self.output, (len(a), m, n))
        solved = np.linalg.solve(np.eye(m) + from_chips, np.concatenate([from_modes, from_chips], axis=2))
        difference = solved - np.hstack([np.zeros((m, n)), np.eye(m)])
        ahead = np.hstack([self.decay, np.zeros((n, m))]) + a * (self.driven @ difference)
        return np.asarray(np.abs(np.linalg.eigvals(np.concatenate([ahead, solved], axis=1))).max(axis=1))


def period_map(structure: Structure, cut: Cut, speed: float, *, nodes: int = NODES, finer: int = 1) -> PeriodMap:
    """Assemble the map of a tooth period at a speed (rad/s); ``finer`` divides every element."""
    times, weights = np.polynomial.legendre.leggauss(nodes)
    inner = (times + 1) / 2
    elements = _elements(structure, cut, speed, finer)
    period = cut.pitch / speed
    poles = structure.poles
    rows = [  # (element, node, immersion) of every tooth in the cut at every node
        (e, k, phi + speed * inner[k] * length)
        for e, (_, length, angles) in enumerate(elements)
        for k in range(nodes)
        for phi in angles
    ]
    element, node = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    phi = np.array([row[2] for row in rows])
    begin, length = (np.array([part[i] for part in elements])[element] for i in range(2))
    at = begin + inner[node] * length
    outward = np.column_stack([np.sin(phi), np.cos(phi), 0 * phi])
    way = np.column_stack(
        [-np.cos(phi) - cut.krc * np.sin(phi), np.sin(phi) - cut.krc * np.cos(phi), -cut.kac + 0 * phi]
    )
    seen = 2 * outward @ structure.tip.T  # (m, n)
    pushed = cut.ktc * way @ structure.entry.T
    inside = {size: _answers(poles, size, inner, weights) for size in np.unique(length)}
    at_end = np.stack([inside[size][1][:, k] for size, k in zip(length, node, strict=True)])  # (m, n)
    since = at[:, None] - (begin + length)[None, :]
    gains = np.zeros((len(rows), len(rows)))
    later = element[:, None] > element[None, :]
    for r, pole in enumerate(poles):
        answer = np.where(later, np.exp(pole * np.where(later, since, 0.0)) * at_end[None, :, r], 0.0)
        for size, (within, _) in inside.items():
            for e in np.unique(element[length == size]):
                own = np.flatnonzero(element == e)
                answer[np.ix_(own, own)] = within[r][np.ix_(node[own], node[own])]
        gains += (seen[:, r, None] * answer * pushed[None, :, r]).real
    start = seen * np.exp(poles[None, :] * at[:, None])
    reached = pushed * np.exp(poles[None, :] * (period - begin - length)[:, None]) * at_end
    turn = np.exp(poles * period)
    return PeriodMap(
        np.hstack([start.real, -start.imag]),
        gains,
        np.block([[np.diag(turn.real), -np.diag(turn.imag)], [np.diag(turn.imag), np.diag(turn.real)]]),
        np.vstack([reached.T.real, reached.T.imag]),
    )


def _elements(structure: Structure, cut: Cut, speed: float, finer: int) -> list[tuple[float, float, list[float]]]:
    """Begin and length (s) of each element with a tooth in the cut, and the teeth's immersions at its begin."""
    arc = cut.leave - cut.start
    marks = np.unique(np.round([0.0, arc % cut.pitch, cut.pitch], 12))
    elements = []
    for begin, end in pairwise(marks):
        teeth = [cut.start + begin + j * cut.pitch for j in range(cut.teeth)]
        angles = [phi for phi in teeth if phi + (end - begin) / 2 < cut.leave]
        if not angles or end - begin < 1e-9:
            continue
        turn = float(np.abs(structure.poles).max()) * (end - begin) / speed
        count = finer * max(1, ceil(turn / LONGEST), ceil((end - begin) / WIDEST))
        width = (end - begin) / count
        elements += [
            ((begin + k * width) / speed, width / speed, [phi + k * width for phi in angles]) for k in range(count)
        ]
    return elements


def _answers(poles: Complex, length: float, inner: Real, weights: Real) -> tuple[Complex, Complex]:
    """Answer of each mode to the polynomial that is 1 at one node: at the nodes (n, k, j), and at the end (n, j)."""
    points, shares = np.polynomial.legendre.leggauss(len(inner) + 8)
    points, shares = (points + 1) / 2, shares / 2
    vandermonde = np.linalg.inv(inner[:, None] ** np.arange(len(inner)))
    ends = np.append(inner, 1.0)
    at = ends[:, None] * points  # (k, points)
    basis = at[..., None] ** np.arange(len(inner)) @ vandermonde  # (k, points, j)
    decay = np.exp(poles[:, None, None] * length * (ends[:, None] - at))
    answer = np.einsum("rkp,kpj,p,k->rkj", decay, basis, shares, ends) * length
    return answer[:, :-1], answer[:, -1]


def radius(structure: Structure, cut: Cut, speed: float, depth: float, *, finer: int = 1) -> float:
    """Largest modulus of the multipliers at one speed (rad/s) and depth (m); below 1 the cut is stable."""
    return float(period_map(structure, cut, speed, finer=finer).radii(np.array([depth]))[0])


def lowest_limit(structure: Structure, cut: Cut, speed: float, max_depth: float, *, finer: int = 1) -> float:
    """Lowest unstable depth (m) at a speed (rad/s), infinite if there is none up to ``max_depth``.

    Depths are tried on a ladder from the safe depth on, so that an island of instability that is wider than a step is
    not missed; the first unstable rung is bisected.
    """
    ahead = period_map(structure, cut, speed, finer=finer)
    low = min(safe_depth(structure, cut), max_depth)
    count = ceil(np.log(max_depth / low) / np.log(LADDER))
    for depth in low * LADDER ** np.arange(1, count + 1):
        if ahead.radii(np.array([min(depth, max_depth)]))[0] > 1:
            return _bisected(ahead, low, float(min(depth, max_depth)))
        low = float(depth)
    return float("inf")


def safe_depth(structure: Structure, cut: Cut) -> float:
    """Depth (m) up to which the cut is stable at every speed: the gain of its loop is below 1.

    A tooth's force is ``depth ktc |way|`` times the chip, and the chip at most twice the tip's motion; the tip moves by
    the largest singular value of its receptance times the force.
    """
    natural = np.abs(structure.poles) / (2 * pi)
    lines = np.concatenate([[0.0], natural, np.geomspace(0.3 * natural.min(), 3 * natural.max(), 4000)])
    largest = float(np.linalg.norm(structure.receptance(lines), 2, axis=(1, 2)).max())
    teeth = ceil((cut.leave - cut.start) / cut.pitch)
    return 1 / (2 * teeth * cut.ktc * float(np.sqrt(1 + cut.krc**2 + cut.kac**2)) * largest)


def _bisected(ahead: PeriodMap, low: float, high: float) -> float:
    """Depth at which the largest multiplier passes 1 between a stable and an unstable depth, to 0.1 %."""
    while high - low > 1e-3 * high:
        tried = np.linspace(low, high, 6)[1:-1]
        unstable = ahead.radii(tried) > 1
        k = int(np.argmax(unstable)) if unstable.any() else len(tried)
        edges = np.array([low, *tried, high])
        low, high = float(edges[k]), float(edges[k + 1])
    return 0.5 * (low + high)


@dataclass(frozen=True)
class Simulated:
    """End of a simulated cut: deviation from one tooth period to the next over the feed, and its growth per second."""

    deviation: float
    growth: float

    @property
    def stable(self) -> bool:
        """Whether the cut nearly repeats itself, and ever more so."""
        return self.deviation < 1e-9 or (self.deviation < SETTLED and self.growth < 0)


def simulated(structure: Structure, cut: Cut, speed: float, depth: float, *, ringing: float = 25.0) -> Simulated:
    """Simulate a cut from rest, its depth rising in the first tenth, over ``ringing`` time constants of the modes."""
    period = cut.pitch / speed
    steps = max(STEPS, ceil(period * 6000.0))
    step = period / steps
    duration = max(ringing / float(np.min(-structure.poles.real)), 60 * period)
    periods = ceil(duration / period)
    i = np.arange(periods * steps)
    depths = np.asarray(depth * np.minimum(1.0, i / (0.1 * len(i))), dtype=float)
    motion = mill(structure, cut, depths, cut.start + speed * step * (i + 0.5), step, np.ones(1))[2]
    by_period = motion.reshape(periods, steps, 3)
    size = np.sqrt((np.diff(by_period, axis=0) ** 2).sum(axis=2).mean(axis=1)) / cut.feed
    ends = [float(np.sqrt(np.mean(part**2))) for part in np.array_split(size[len(size) // 3 :], 8)]
    if not np.isfinite(ends[-1]):
        return Simulated(float("inf"), float("inf"))
    slope = np.polyfit(np.arange(8), np.log(np.maximum(ends, 1e-15)), 1)[0]
    return Simulated(ends[-1], float(slope / (duration / 12)))


def rpm(speed: float | Real) -> Real:
    """Turns a minute as rad/s."""
    return np.asarray(speed) * pi / 30
