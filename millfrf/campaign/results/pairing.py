"""Optimal pairing of two lists of modes by frequency and shape."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, DegreeOfFreedom, Real

from .sets import SetResults
from .settings import SETTINGS


@dataclass(frozen=True)
class SeenMode:
    """Frequency and shape of one mode, or the mean of several estimates of one mode."""

    source: tuple[str, int]  # set, and number in its model from 0 (of a mean: the first)
    log_frequency: float  # natural logarithm of the frequency in Hz
    points: tuple[str, ...]  # points with axes, without sign
    shape: Complex  # (n_points,); see :func:`normalised`


def seen_modes(results: SetResults) -> list[SeenMode]:
    if results.model is None:
        return []
    parsed = [DegreeOfFreedom.parse(label) for label in results.model.responses]
    points = tuple(f"{dof.node}:{dof.direction[1:]}" for dof in parsed)
    signs = np.array([dof.sign for dof in parsed])
    return [
        SeenMode((results.name, i), float(np.log(frequency)), points, normalised(results.model.right[i] * signs))
        for i, frequency in enumerate(results.model.natural_frequencies)
    ]


def normalised(shape: Complex) -> Complex:
    """Scale a shape to length one and rotate it so that the sum of its squares is real and positive."""
    size = float(np.linalg.norm(shape))
    if size == 0:
        return shape
    turned = shape * np.exp(-0.5j * np.angle(np.sum(shape**2)))
    return np.asarray(turned / size)


def likeness(first: SeenMode, second: SeenMode) -> float:
    """Return the modal assurance criterion over common points; NaN with fewer than two."""
    shared = [name for name in first.points if name in second.points]
    if len(shared) < 2:
        return float("nan")
    a = first.shape[[first.points.index(name) for name in shared]]
    b = second.shape[[second.points.index(name) for name in shared]]
    size = float(np.sum(np.abs(a) ** 2) * np.sum(np.abs(b) ** 2))
    return float(abs(np.vdot(a, b)) ** 2 / size) if size else float("nan")


def mean_mode(modes: Sequence[SeenMode]) -> SeenMode:
    """Return the mean frequency and the mean shape over the common points."""
    points = tuple(name for name in modes[0].points if all(name in mode.points for mode in modes))
    total = np.zeros(len(points), dtype=complex)
    for mode in modes:
        shape = mode.shape[[mode.points.index(name) for name in points]]
        # the sign of a mode shape is arbitrary
        total = total + (shape if np.vdot(total, shape).real >= 0 else -shape)
    frequency = float(np.mean([mode.log_frequency for mode in modes]))
    return SeenMode(modes[0].source, frequency, points, normalised(total))


@dataclass(frozen=True)
class Pairing:
    """Two modes that are identified as the same mode."""

    first: int  # number in the first list
    second: int  # number in the second list
    likeness: float  # MAC; NaN: fewer than two common points
    margin: float  # increase of the total squared distance if these two are not paired

    @property
    def doubt(self) -> str:
        """Return the reason why the two modes may be different; an empty text if the pair is certain.

        Examples
        --------
        >>> Pairing(0, 1, 0.1, 9.0).doubt
        'shapes are unlike (MAC 0.10)'
        """
        if self.likeness < SETTINGS.least_mac:
            return f"shapes are unlike (MAC {self.likeness:.2f})"
        return "another mode is as near in frequency and shape" if self.margin < SETTINGS.least_margin else ""


def pair_modes(first: Sequence[SeenMode], second: Sequence[SeenMode], frequency_scale: float) -> list[Pairing]:
    """Pair two lists of modes with the least total of ``(log(f/g) / a)^2 + (1 - MAC) / b^2``.

    The modes of a pair have the frequencies f and g (Hz); a is ``frequency_scale``, b ``shape_scale``. Leaving two
    modes unpaired costs ``unpaired_cost``, so two modes whose pair would cost more stay unpaired.
    """
    if not first or not second:
        return []
    mac = np.array([[likeness(a, b) for b in second] for a in first])
    ratio = np.subtract.outer([a.log_frequency for a in first], [b.log_frequency for b in second])
    distance = (ratio / frequency_scale) ** 2 + np.nan_to_num(1 - mac) / SETTINGS.shape_scale**2
    best, chosen = _least(distance)
    pairs = []
    for i, j in chosen:
        without = distance.copy()
        without[i, j] = np.inf
        pairs.append(Pairing(i, j, float(mac[i, j]), float(_least(without)[0] - best)))
    return pairs


def _least(distance: Real) -> tuple[float, list[tuple[int, int]]]:
    """Solve the assignment problem; return the total cost minus the cost without any pair, and the pairs."""
    gain = np.minimum(distance, SETTINGS.unpaired_cost) - SETTINGS.unpaired_cost
    rows, columns = scipy.optimize.linear_sum_assignment(gain)
    pairs = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] < SETTINGS.unpaired_cost]
    return float(sum(gain[i, j] for i, j in pairs)), pairs
