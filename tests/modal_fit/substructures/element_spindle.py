"""A spindle with holder and tool of Timoshenko elements, and taps on it; it shares no code with the product."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf

STEEL = {"youngs_modulus_pa": 205e9, "density_kg_per_m3": 7850.0, "poissons_ratio": 0.29, "loss_factor": 0.002}
CARBIDE = {"youngs_modulus_pa": 585e9, "density_kg_per_m3": 14400.0, "poissons_ratio": 0.22, "loss_factor": 0.0015}


@dataclass(frozen=True)
class Cylinder:
    """A cylinder with its material; ``share`` of the diameter is left by flutes."""

    length: float
    diameter: float
    material: Mapping[str, float] = field(default_factory=lambda: CARBIDE)
    share: float = 1.0

    @property
    def outer(self) -> float:
        """The diameter that bends."""
        return self.share * self.diameter


def element(cylinder: Cylinder, length: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Stiffness and consistent mass of an element over ``(w, theta)`` of both ends (Friedman & Kosmatka 1993)."""
    e, rho, nu = (cylinder.material[name] for name in ("youngs_modulus_pa", "density_kg_per_m3", "poissons_ratio"))
    area, moment = np.pi / 4 * cylinder.outer**2, np.pi / 64 * cylinder.outer**4
    shear = 6 * (1 + nu) / (7 + 6 * nu) * e / (2 * (1 + nu)) * area
    p, x = 12 * e * moment / (shear * length**2), length
    stiffness = np.array(
        [
            [12, 6 * x, -12, 6 * x],
            [6 * x, (4 + p) * x**2, -6 * x, (2 - p) * x**2],
            [-12, -6 * x, 12, -6 * x],
            [6 * x, (2 - p) * x**2, -6 * x, (4 + p) * x**2],
        ]
    ) * (e * moment / ((1 + p) * x**3))
    a = 70 * p**2 + 147 * p + 78
    b = (35 * p**2 + 77 * p + 44) * x / 4
    c = 35 * p**2 + 63 * p + 27
    d = -(35 * p**2 + 63 * p + 26) * x / 4
    g = (7 * p**2 + 14 * p + 8) * x**2 / 4
    h = -(7 * p**2 + 14 * p + 6) * x**2 / 4
    moved = np.array([[a, b, c, d], [b, g, -d, h], [c, -d, a, -b], [d, h, -b, g]]) * (
        rho * area * x / (210 * (1 + p) ** 2)
    )
    q = -(15 * p - 3) * x
    r = (10 * p**2 + 5 * p + 4) * x**2
    s = (5 * p**2 - 5 * p - 1) * x**2
    turned = np.array([[36, q, -36, q], [q, r, -q, s], [-36, -q, 36, -q], [q, s, -q, r]]) * (
        rho * moment / (30 * (1 + p) ** 2 * x)
    )
    return stiffness * (1 + 1j * cylinder.material["loss_factor"]), moved + turned


@dataclass(frozen=True)
class Spindle:
    """A shaft on two bearings with a holder; the tool is joined to its nose rigidly or by springs."""

    shaft: tuple[Cylinder, ...]
    bearings: tuple[tuple[float, float, float], ...]  # place (m), stiffness (N/m), damping (N s/m)
    contact: tuple[complex, complex] | None = None  # N/m and N m/rad, complex with loss

    def receptance(
        self, tool: Sequence[Cylinder], distances: Sequence[float], frequencies: NDArray[Any], size: float = 2.5e-3
    ) -> NDArray[Any]:
        """Receptance (n, m, m) between points of the tool (or holder) at distances from the tip."""
        parts = [(cylinder, 0) for cylinder in self.shaft] + [(cylinder, 1) for cylinder in tool]
        nodes, elements, owner = [0.0], [], [0]
        nose = sum(cylinder.length for cylinder in self.shaft)
        total = nose + sum(cylinder.length for cylinder in tool)
        marks = [total - distance for distance in distances] + [place for place, _, _ in self.bearings]
        start = 0.0
        for cylinder, side in parts:
            if side and not owner[-1] and self.contact is not None:
                nodes.append(start)
                owner.append(1)
            inner = [mark for mark in marks if start + 1e-9 < mark < start + cylinder.length - 1e-9]
            edges = [start, *sorted(inner), start + cylinder.length]
            for a, b in pairwise(edges):
                count = max(1, int(np.ceil((b - a) / size)))
                for k in range(count):
                    elements.append((len(nodes) - 1, cylinder, (b - a) / count))
                    nodes.append(a + (b - a) * (k + 1) / count)
                    owner.append(side)
            start += cylinder.length
        n = 2 * len(nodes)
        stiffness, mass, damping = np.zeros((n, n), complex), np.zeros((n, n)), np.zeros((n, n))
        for first, cylinder, length in elements:
            k, m = element(cylinder, length)
            both = slice(2 * first, 2 * first + 4)
            stiffness[both, both] += k
            mass[both, both] += m
        places = np.array(nodes)
        for place, k, c in self.bearings:
            node = 2 * int(np.argmin(np.abs(places - place)))
            stiffness[node, node] += k
            damping[node, node] += c
        if self.contact is not None:
            first = 2 * owner.index(1) - 2
            for dof, spring in enumerate(self.contact):
                pair = np.ix_([first + dof, first + 2 + dof], [first + dof, first + 2 + dof])
                stiffness[pair] += spring * np.array([[1, -1], [-1, 1]])
        points = [2 * int(np.argmin(np.abs(places - (total - distance)))) for distance in distances]
        load = np.zeros((n, len(points)))
        load[points, np.arange(len(points))] = 1.0
        out = np.empty((len(frequencies), len(points), len(points)), complex)
        stiffness, damping, mass = (banded(matrix) for matrix in (stiffness, damping, mass))
        for number, w in enumerate(2 * np.pi * frequencies):
            dynamic = stiffness + 1j * w * damping - w**2 * mass
            out[number] = scipy.linalg.solve_banded((3, 3), dynamic, load, check_finite=False)[points]
        return out


def banded(matrix: NDArray[Any]) -> NDArray[Any]:
    """Seven diagonals of a matrix, as solve_banded takes them."""
    n = len(matrix)
    rows = np.zeros((7, n), dtype=matrix.dtype)
    for offset in range(-3, 4):
        diagonal = np.diagonal(matrix, offset)
        rows[3 - offset, max(offset, 0) : max(offset, 0) + len(diagonal)] = diagonal
    return rows


def spindle_in(direction: str, contact: tuple[complex, complex] | None = None) -> Spindle:
    """A high-speed spindle of about 60 N/um at the nose, a little different in X and Y."""
    stiffer = 1.0 if direction == "X" else 1.18
    shaft = (
        Cylinder(0.10, 0.050, STEEL),
        Cylinder(0.16, 0.060, STEEL),
        Cylinder(0.06, 0.055, STEEL),
        Cylinder(0.07, 0.036, STEEL),
    )
    bearings = ((0.04, 0.9e8 * stiffer, 700.0), (0.22, 1.5e8 * stiffer, 1500.0))
    return Spindle(shaft, bearings, contact)


def tapped(
    receptance: Mapping[str, NDArray[Any]],
    points: Sequence[str],
    frequencies: NDArray[Any],
    rng: np.random.Generator,
    *,
    noise: float = 0.003,
    taps: int = 5,
) -> Frf:
    """H1 and coherence of taps at all points of one blank, with white noise on the accelerance.

    ``noise``: standard deviation of one tap over the root mean square of the direct accelerance at the tip.
    """
    names = tuple(f"{point}:+{direction}" for direction in receptance for point in points)
    n, size = len(points), len(names)
    values, coherence = (
        np.zeros((len(frequencies), size, size), complex),
        np.full((len(frequencies), size, size), np.nan),
    )
    measured = np.zeros((size, size), dtype=bool)
    square = -((2 * np.pi * frequencies) ** 2)
    for number, matrix in enumerate(receptance.values()):
        block = slice(n * number, n * number + n)
        measured[block, block] = True
        level = noise * np.sqrt(np.mean(np.abs(matrix[:, 0, 0] * square) ** 2))
        force = rng.uniform(0.6, 1.4, taps)[:, None, None, None]  # alike over the band
        clean = matrix * square[:, None, None]
        parts = rng.standard_normal((2, taps, *matrix.shape))
        motion = clean * force + level * np.sqrt(0.5) * (parts[0] + 1j * parts[1])
        ff, xf = np.sum(force**2, axis=0), np.sum(motion * force, axis=0)
        values[:, block, block] = xf / ff
        coherence[:, block, block] = np.abs(xf) ** 2 / (ff * np.sum(np.abs(motion) ** 2, axis=0))
    kept = None if measured.all() else measured
    return Frf(
        frequencies,
        values,
        names,
        names,
        "accelerance",
        "m/s^2/N",
        np.ones(len(frequencies), dtype=bool),
        coherence=coherence,
        averages=np.where(measured, taps, 0),
        band=(float(frequencies[0]), float(frequencies[-1])),
        measured=kept,
    )
