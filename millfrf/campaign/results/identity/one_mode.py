"""`SeenMode`: a mode as identification sees it, by its frequency and its shape, and the mean of several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import DegreeOfFreedom

from ..read_set import SetResults

Complex = NDArray[np.complex128]


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
