"""Pairing of modes at the least total distance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, DegreeOfFreedom, Real

from .sets import SetResults


@dataclass(frozen=True)
class SeenMode:
    """Frequency and shape of a mode, or of the mean of modes that are the same.

    Parameters
    ----------
    source
        Name of its set and number in the set's model, from 0; of a mean the first of its modes.
    log_frequency
        Natural logarithm of the natural frequency in Hz.
    points
        Names of points with their axes, without sign.
    shape : (n_points,)
        Shape at the points, of length one and turned to be real where it can.
    """

    source: tuple[str, int]
    log_frequency: float
    points: tuple[str, ...]
    shape: Complex


def seen_modes(one: SetResults) -> list[SeenMode]:
    """The modes of a set in the order of its model.

    Parameters
    ----------
    one
        A set with a modal model.
    """
    if one.model is None:
        return []
    parsed = [DegreeOfFreedom.parse(label) for label in one.model.responses]
    points = tuple(f"{dof.node}:{dof.direction[1:]}" for dof in parsed)
    signs = np.array([dof.sign for dof in parsed])
    return [
        SeenMode((one.name, i), float(np.log(frequency)), points, normalised(one.model.right[i] * signs))
        for i, frequency in enumerate(one.model.natural_frequencies)
    ]


def normalised(shape: Complex) -> Complex:
    """A shape of length one, turned so that the sum of its squares is real and positive."""
    size = float(np.linalg.norm(shape))
    if size == 0:
        return shape
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    return np.asarray(turned / size)


def likeness(first: SeenMode, second: SeenMode) -> float:
    """Modal assurance criterion over the points that both share; NaN with fewer than two."""
    shared = [name for name in first.points if name in second.points]
    if len(shared) < 2:
        return float("nan")
    a = first.shape[[first.points.index(name) for name in shared]]
    b = second.shape[[second.points.index(name) for name in shared]]
    size = float(np.sum(np.abs(a) ** 2) * np.sum(np.abs(b) ** 2))
    return float(abs(np.vdot(a, b)) ** 2 / size) if size else float("nan")


def mean_mode(modes: Sequence[SeenMode]) -> SeenMode:
    """Mean frequency and mean shape of modes that are the same; points that not all share are left out.

    Parameters
    ----------
    modes
        One mode or more.
    """
    points = tuple(name for name in modes[0].points if all(name in one.points for one in modes))
    total = np.zeros(len(points), dtype=complex)
    for one in modes:
        shape = one.shape[[one.points.index(name) for name in points]]
        total = total + (shape if np.vdot(total, shape).real >= 0 else -shape)
    frequency = float(np.mean([one.log_frequency for one in modes]))
    return SeenMode(modes[0].source, frequency, points, normalised(total))


ALONE = 16.0
"""Distance from which two modes are better left without partners: four times a scale."""

TOLD = 4.0
"""Distance by which the best pairing must beat the next one, so that the pair counts as told: two standard errors."""

SHAPE_SCALE = 0.3
"""Difference of shapes, the root of ``1 - MAC``, that weighs as much as one scale of frequency."""

UNLIKE = 0.3
"""MAC below which a pair is doubted: the two may be different modes of one frequency."""


@dataclass(frozen=True)
class Pairing:
    """Two modes taken for the same.

    Parameters
    ----------
    first, second
        Numbers of the modes in the two lists.
    likeness
        Modal assurance criterion of the two shapes; NaN: shapes cannot be compared.
    margin
        By how much the total distance grows when these two are not paired.
    """

    first: int
    second: int
    likeness: float
    margin: float

    @property
    def doubt(self) -> str:
        """Why the two may be different modes; empty: no doubt.

        Examples
        --------
        >>> Pairing(0, 1, 0.1, 9.0).doubt
        'shapes are unlike (MAC 0.10)'
        """
        if self.likeness < UNLIKE:
            return f"shapes are unlike (MAC {self.likeness:.2f})"
        return "another mode is as near in frequency and shape" if self.margin < TOLD else ""


def pair_modes(first: Sequence[SeenMode], second: Sequence[SeenMode], frequency_scale: float) -> list[Pairing]:
    """Pair two lists of modes at the least total distance ``(log(f/g) / a)^2 + (1 - MAC) / b^2``.

    Modes farther apart than ``ALONE`` stay without a partner.

    Parameters
    ----------
    first, second
        Modes of two sets, or means of several.
    frequency_scale
        Difference a of the logarithms of frequency that weighs one.
    """
    if not first or not second:
        return []
    alike = np.array([[likeness(a, b) for b in second] for a in first])
    ratio = np.subtract.outer([a.log_frequency for a in first], [b.log_frequency for b in second])
    distance = (ratio / frequency_scale) ** 2 + np.nan_to_num(1 - alike) / SHAPE_SCALE**2
    best, chosen = _least(distance)
    found = []
    for i, j in chosen:
        without = distance.copy()
        without[i, j] = np.inf
        found.append(Pairing(i, j, float(alike[i, j]), float(_least(without)[0] - best)))
    return found


def _least(distance: Real) -> tuple[float, list[tuple[int, int]]]:
    """Least total of pairs, and of ``ALONE`` for every two modes without a partner."""
    gain = np.minimum(distance, ALONE) - ALONE
    rows, columns = scipy.optimize.linear_sum_assignment(gain)
    kept = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] < ALONE]
    return float(sum(gain[i, j] for i, j in kept)), kept
