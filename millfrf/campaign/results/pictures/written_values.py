"""`free_sides`: at which side of a mark its value can be written without covering another."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

PANEL = (112.0, 95.0)
"""Room of the marks in a panel, points."""

MARK, LETTER, HEIGHT = 7.0, 3.9, 6.5
"""Sizes of a mark, of a letter's width and of a line, points."""

Real = NDArray[np.float64]


def free_sides(places: Real, texts: Sequence[str]) -> list[tuple[float, float] | None]:
    """Place of each text beside its mark, points; None where each side is taken.

    Parameters
    ----------
    places : (n, 2)
        Places of the marks, in any unit.
    texts
        What is written beside each.

    Examples
    --------
    >>> free_sides(np.array([[0.0, 0.0], [1.0, 1.0]]), ["1.2", "3.4"])
    [(0.0, 7.0), (0.0, 7.0)]
    """
    span = np.ptp(places, axis=0)
    at = (places - places.min(axis=0)) / np.where(span > 0, span, 1.0) * PANEL
    taken = [(*one, MARK, MARK) for one in at]
    found: list[tuple[float, float] | None] = []
    for number, text in enumerate(texts):
        size = (LETTER * len(text), HEIGHT)
        others = [box for k, box in enumerate(taken) if k != number]
        boxes = {side: (*(at[number] + side), *size) for side in _sides(size[0])}
        free = [side for side, own in boxes.items() if not any(_meet(own, box) for box in others)]
        found.append(free[0] if free else None)
        if free:
            taken.append((*(at[number] + free[0]), *size))
    return found


def _sides(width: float) -> tuple[tuple[float, float], ...]:
    """Middle of a text from the mark, points: above, below, right, left."""
    beside = (MARK + width) / 2 + 1.0
    return (0.0, 7.0), (0.0, -7.0), (beside, 0.0), (-beside, 0.0)


def _meet(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two boxes (middle, width, height) cover each other."""
    return abs(one[0] - other[0]) < (one[2] + other[2]) / 2 and abs(one[1] - other[1]) < (one[3] + other[3]) / 2
