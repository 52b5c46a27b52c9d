"""A milling simulator of its own, sharing no code with the package: runout, regeneration, process damping, helix."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Real = NDArray[np.float64]

SLICES = 8
"""Along a helical edge."""


@dataclass(frozen=True)
class Mill:
    """A square end mill on one oscillator an axis; SI units."""

    teeth: int = 2
    diameter: float = 12.7e-3
    ktc: float = 119e6
    krc: float = 0.17
    kac: float = 0.33
    start: float = math.pi / 2
    leave: float = math.pi
    feed: float = 0.15e-3
    offsets: tuple[float, ...] = (0.0, 0.0)
    feedback: float = 1.0
    damping: float = 0.0
    depth: float = 1e-3
    rpm: float = 800.0
    frequencies: tuple[float, float, float] = (17.0, 19.0, 60.0)
    stiffness: tuple[float, float, float] = (4e5, 6e5, 2e6)
    ratio: float = 0.04
    helix: float = 0.0


def simulated(mill: Mill, seconds: float, noise: float, seed: int) -> tuple[Real, Real, float]:
    """Forces and accelerations (n, 3) with white noise, a share of each channel's deviation, and the rate, Hz."""
    per_tooth = round(60 / mill.rpm / mill.teeth * 20000)
    step = 60 / mill.rpm / mill.teeth / per_tooth
    natural = 2 * np.pi * np.array(mill.frequencies)
    stiffness = np.array(mill.stiffness)
    force, acceleration = _march(
        round(seconds / step), step, per_tooth, np.array(mill.offsets), natural, natural**2 / stiffness, mill.ratio,
        (mill.start, mill.leave, mill.feed, mill.depth, mill.ktc, mill.krc, mill.kac, mill.feedback,
         mill.damping / (math.pi * mill.rpm / 60 * mill.diameter)),
        1 if mill.helix == 0 else SLICES, math.tan(mill.helix) * mill.depth * 2 / mill.diameter,
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    noisy = [each + noise * each.std(axis=0) * rng.standard_normal(each.shape) for each in (force, acceleration)]
    return noisy[0], noisy[1], 1 / step


@njit(cache=True)
def _march(
    n: int,
    step: float,
    per_tooth: int,
    offsets: Real,
    natural: Real,
    inverse_mass: Real,
    ratio: float,
    cut: tuple[float, ...],
    slices: int,
    lag: float,
) -> tuple[Real, Real]:
    start, leave, feed, depth, ktc, krc, kac, feedback, rub = cut
    teeth = len(offsets)
    x, v, a = np.zeros(3), np.zeros(3), np.zeros(3)
    surface = np.zeros((per_tooth, teeth, slices))
    force, acceleration = np.zeros((n, 3)), np.zeros((n, 3))
    turn = 2 * math.pi / teeth / per_tooth
    for i in range(n):
        for p in range(3):
            x[p] += step * v[p] + 0.5 * step**2 * a[p]
        half = v + 0.5 * step * a
        total = np.zeros(3)
        slot = i % per_tooth
        for k in range(slices):
            behind = lag * (k + 0.5) / slices if slices > 1 else 0.0
            before = surface[slot, :, k].copy()
            for j in range(teeth):
                phi = (turn * i + 2 * math.pi * j / teeth - behind) % (2 * math.pi)
                low, high = max(phi - turn / 2, start), min(phi + turn / 2, leave)
                if high <= low:
                    surface[slot, j, k] = 0.0
                    continue
                sine, cosine = math.sin(phi), math.cos(phi)
                edge = feedback * (x[0] * sine + x[1] * cosine) + offsets[j]
                ahead = before[(j + 1) % teeth] if i >= per_tooth else offsets[(j + 1) % teeth]
                chip = edge - ahead + feed * sine
                surface[slot, j, k] = edge if chip > 0 else ahead - feed * sine
                if chip > 0:
                    width = depth / slices * (high - low) / turn
                    tangential = width * ktc * chip
                    rubbing = width * rub * (half[0] * sine + half[1] * cosine)
                    radial = krc * tangential + rubbing
                    total[0] += -tangential * cosine - radial * sine
                    total[1] += tangential * sine - radial * cosine
                    total[2] += -kac * tangential
        for p in range(3):
            new = inverse_mass[p] * total[p] - natural[p] ** 2 * x[p] - 2 * ratio * natural[p] * half[p]
            v[p] = half[p] + 0.5 * step * new
            a[p] = new
            force[i, p], acceleration[i, p] = total[p], new
    return force, acceleration
