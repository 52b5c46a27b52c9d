"""Draw where the modes of a set lie: natural frequencies, dampings, close pairs, band edges and line spacing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
MAX_LINES = 8000
"""From 0 Hz to the top of the axis."""
FEWEST_LINES = 60
"""In the band."""
COARSE_SHARE = 0.2
"""Share of sets with 3 to 4 lines in the narrowest mode's half-power bandwidth; the others have 5 to 15."""


@dataclass(frozen=True)
class Spectrum:
    """Modes, band and axis of one set.

    Parameters
    ----------
    frequencies, dampings : (n_modes,)
        Hz and ratio, rising, with those outside the band.
    inside : (n_modes,), bool
        In the band.
    pairs
        Index of the lower mode of each close pair.
    n_far
        How many of the highest modes are far above the band.
    band : Hz
        Lowest and highest frequency of the band.
    step, top
        Line spacing and highest line, Hz.
    """

    frequencies: Real
    dampings: Real
    inside: NDArray[np.bool_]
    pairs: tuple[int, ...]
    n_far: int
    band: tuple[float, float]
    step: float
    top: float


def draw_spectrum(rng: np.random.Generator, n_inside: int, max_lines: int) -> Spectrum:
    """Modes from low to high, each a random gap above the last one.

    A gap is 2.5 to 30 % of the frequency (log-uniform) and at least two mean half-power bandwidths; that of a close
    pair is 0.4 to 1 of them. Band edges lie anywhere between the outer modes inside and their neighbours outside, but
    1.5 bandwidths (and 1 % of frequency) from those inside and one bandwidth from those outside.
    """
    n_below, n_near, n_far = int(rng.integers(0, 3)), int(rng.integers(1, 4)), int(rng.integers(0, 4))
    n_modes = n_below + n_inside + n_near
    zeta = _dampings(rng, n_modes)
    pairs = _pairs(rng, n_below, n_inside)
    f = np.empty(n_modes)
    f[0] = 10 ** rng.uniform(1.0, 2.7)
    edges = []
    for k in range(1, n_modes):
        relative = 10 ** rng.uniform(-1.6, -0.52)
        mean = zeta[k - 1] + zeta[k]  # mean half-power bandwidth over frequency
        crossed = k in (n_below, n_below + n_inside)
        if k - 1 in pairs:
            relative = rng.uniform(0.4, 1.0) * mean
        elif crossed:
            relative = max(relative, 1.6 * (_room(zeta[k - 1], k > n_below) + _room(zeta[k], k == n_below)))
        else:
            relative = max(relative, 2 * mean)
        f[k] = f[k - 1] * (1 + relative)
        if crossed:
            low = f[k - 1] * (1 + _room(zeta[k - 1], k > n_below))
            edges.append(rng.uniform(low, max(low, f[k] * (1 - _room(zeta[k], k == n_below)))))
    if n_below == 0:
        edges.insert(0, f[0] * rng.uniform(0.4, 1 - _room(zeta[0], True)))
    band = (edges[0], edges[1])
    inside = np.arange(n_modes) - n_below
    inside_mask = (inside >= 0) & (inside < n_inside)
    top = band[1] * rng.uniform(1.03, 1.25)
    zeta, step = _resolved(rng, f, zeta, inside_mask, top, max_lines)
    step = min(step, (band[1] - band[0]) / FEWEST_LINES)
    far = top * rng.uniform(1.3, 6.0, n_far)
    far.sort()
    return Spectrum(
        np.concatenate([f, far]),
        np.concatenate([zeta, rng.uniform(0.005, 0.03, n_far)]),
        np.concatenate([inside_mask, np.zeros(n_far, bool)]),
        pairs,
        n_far,
        band,
        step,
        top,
    )


def _dampings(rng: np.random.Generator, n: int) -> Real:
    """About a level of the set: 0.1 to 5 %, in one set of ten 2 to 10 %."""
    low, high = (0.02, 0.10) if rng.random() < 0.1 else (0.001, 0.05)
    level = np.exp(rng.uniform(np.log(low), np.log(high)))
    return np.asarray(np.clip(level * np.exp(0.4 * rng.standard_normal(n)), low, high))


def _pairs(rng: np.random.Generator, n_below: int, n_inside: int) -> tuple[int, ...]:
    """None in two sets of five, one in two of five, two in one of five where the modes suffice."""
    wanted = min(int(rng.choice([0, 0, 1, 1, 2])), n_inside // 2)
    chosen: list[int] = []
    for k in rng.permutation(np.arange(n_below, n_below + n_inside - 1)):
        if len(chosen) < wanted and all(abs(k - other) > 2 for other in chosen):
            chosen.append(int(k))
    return tuple(sorted(chosen))


def _room(zeta: float, is_inside: bool) -> float:
    """Least distance between a mode and the band's edge, over the frequency."""
    return max(3 * zeta, 0.01) if is_inside else max(2 * zeta, 0.005)


def _resolved(
    rng: np.random.Generator, f: Real, zeta: Real, inside: NDArray[np.bool_], top: float, max_lines: int
) -> tuple[Real, float]:
    """Line spacing from the narrowest mode inside; where lines would be too many, narrow modes become wider."""
    lines = rng.uniform(3, 4) if rng.random() < COARSE_SHARE else rng.uniform(5, 15)
    step = max(float((2 * zeta * f)[inside].min()) / lines, top / max_lines)
    least = 3.0 * step / (2 * f)
    return np.where(inside & (zeta < least), least * rng.uniform(1.0, 1.3, len(f)), zeta), step
