"""Pairs of modes at the least total distance, and how much worse the next best pairing is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from .one_mode import SeenMode, likeness

Real = NDArray[np.float64]

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
    rows, columns = linear_sum_assignment(gain)
    kept = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if distance[i, j] < ALONE]
    return float(sum(gain[i, j] for i, j in kept)), kept
