"""Draw the vectors of a set: how its points and references move in each mode."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Layout:
    """Points and references of a set.

    Parameters
    ----------
    references : (n_references,)
        For each the number of the point that it shares (a driving point), or -1.
    roving_hammer
        The references respond and the points are struck; otherwise the references excite.
    """

    n_points: int
    references: NDArray[np.int64]
    roving_hammer: bool

    @property
    def labels(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Of points and of references."""
        points = tuple(f"P{k + 1}:+Z" for k in range(self.n_points))
        shared = enumerate(self.references, 1)
        return points, tuple(points[point] if point >= 0 else f"R{k}:+Z" for k, point in shared)


def draw_layout(rng: np.random.Generator) -> Layout:
    """3 to 100 points (log-uniform), 1 to 6 references, two of three of them at a point."""
    n_points = int(np.floor(np.exp(rng.uniform(np.log(3), np.log(101)))))
    n_references = int(rng.choice([1, 2, 3, 4, 5, 6], p=[0.3, 0.2, 0.2, 0.1, 0.1, 0.1]))
    shared = rng.permutation(max(n_points, n_references))[:n_references]
    shared = np.where((shared < n_points) & (rng.random(n_references) < 2 / 3), shared, -1)
    return Layout(n_points, shared, bool(rng.random() < 0.5))


def draw_shapes(rng: np.random.Generator, layout: Layout, n_modes: int, n_far: int) -> tuple[Complex, Complex]:
    """Vectors over the points and over the references, (n_modes, n_points) and (n_modes, n_references).

    Half of the sets are plates with products of sines, that have nodal lines; half have normal random vectors. Half are
    real; in the others each component turns by 0.05 to 0.5 rad (standard deviation) but far modes. In one set of seven
    the references' vectors are scaled at random, so that it is not reciprocal.
    """
    n_all = layout.n_points + len(layout.references)
    vectors = _plate(rng, n_modes, n_all) if rng.random() < 0.5 else rng.standard_normal((n_modes, n_all))
    vectors = vectors * np.exp(0.3 * rng.standard_normal((n_modes, 1)))
    turn = rng.uniform(0.05, 0.5) if rng.random() < 0.5 else 0.0
    angles = turn * rng.standard_normal((n_modes, n_all))
    angles[n_modes - n_far :] = 0.0
    moving = vectors * np.exp(1j * angles)
    points, references = moving[:, : layout.n_points], moving[:, layout.n_points :].copy()
    driving = layout.references >= 0
    references[:, driving] = points[:, layout.references[driving]]
    if rng.random() < 1 / 7:
        references = references * np.exp(0.5 * rng.standard_normal(references.shape))
    return points, references


def _plate(rng: np.random.Generator, n_modes: int, n_all: int) -> NDArray[np.float64]:
    """``2 sin(a pi x) sin(b pi y)`` at random places, wave numbers in the order of a plate's frequencies."""
    x, y = rng.uniform(0.05, 0.95, (2, n_all))
    ratio = rng.uniform(1.0, 2.0)
    waves = sorted(((a, b) for a in range(1, 9) for b in range(1, 9)), key=lambda w: w[0] ** 2 + (ratio * w[1]) ** 2)
    first = int(rng.integers(0, 6))
    chosen = np.array(waves[first : first + n_modes], dtype=float)
    return np.asarray(2 * np.sin(np.pi * np.outer(chosen[:, 0], x)) * np.sin(np.pi * np.outer(chosen[:, 1], y)))
