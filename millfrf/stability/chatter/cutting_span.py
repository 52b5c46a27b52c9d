"""The part of a recording in which the tool cuts."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import THRESHOLDS
from .spindle import Revolutions

_BLOCK = 8  # revolutions whose mean gives the size of the orders


def span_in_cut(revolutions: Revolutions, *, of_orders: bool = True) -> tuple[int, int]:
    """Return the first revolution of the longest part in the cut, and the one after its last.

    Teeth in the cut cause orders of the spindle several times as large as those of an idle spindle. The sizes of
    blocks of revolutions are divided into two classes (Otsu, IEEE Trans. Syst. Man Cybern. 9, 1979), and the longest
    part of the larger class is taken if the classes differ that much; otherwise the whole recording. Without
    ``of_orders`` the sizes are those of all motion.
    """
    sizes = np.log(np.maximum(_sizes(revolutions, of_orders), 1e-300))
    whole = (0, revolutions.count)
    if len(sizes) < 4:
        return whole
    limit, ratio = two_classes(sizes)
    if ratio < np.log(THRESHOLDS.idle_ratio):
        return whole
    first, last = _longest(sizes > limit)
    if (last - first) * _BLOCK < THRESHOLDS.least_revolutions:
        return whole
    return first * _BLOCK, last * _BLOCK


def unrepeated_elsewhere(revolutions: Revolutions, first: int, last: int) -> tuple[int, int] | None:
    """Return the revolutions of the longest part that is not judged, cuts, and does not repeat; None without one.

    Judged is the second half of the part in the cut from ``first`` to ``last``. Its first eighth is left out, because
    the entry of a stable cut does not repeat either.
    """
    block, middle = THRESHOLDS.shortest_segment, (first + last) // 2
    least = 0.5 * float(np.sum(revolutions.part(middle, last).size ** 2))
    suspect = np.zeros(revolutions.count // block, dtype=bool)
    for number in range(len(suspect)):
        begin, end = number * block, (number + 1) * block
        is_entry = begin < first + (last - first) // 8 and end > first
        if is_entry or (begin < last and end > middle):
            continue
        part = revolutions.part(begin, end)
        motion = float(np.sum(part.size**2))
        unrepeated = float(np.sum(part.residual.var(axis=0)))
        suspect[number] = motion > least and unrepeated > THRESHOLDS.unexplained**2 * motion
    begin, end = _longest(suspect) if suspect.any() else (0, 0)
    return (begin * block, end * block) if end - begin > 1 else None


def _sizes(revolutions: Revolutions, of_orders: bool) -> Real:
    """Compute the size of the orders, or of all motion, in blocks of revolutions, of all channels, (n_blocks,)."""
    count = revolutions.count // _BLOCK
    blocks = revolutions.samples[: count * _BLOCK].reshape(count, _BLOCK, *revolutions.samples.shape[1:])
    turns = blocks.mean(axis=1) if of_orders else blocks.reshape(count, -1, blocks.shape[3])
    return np.asarray(np.sqrt(np.sum(turns.var(axis=1), axis=1)))


def two_classes(values: Real) -> tuple[float, float]:
    """Return the limit between two classes with the largest variance between them, and the difference of medians."""
    ordered = np.sort(values)
    count = len(ordered)
    below = np.arange(1, count)
    sums = np.cumsum(ordered)[:-1]
    between = (sums / below - (ordered.sum() - sums) / (count - below)) ** 2 * below * (count - below)
    split = int(np.argmax(between)) + 1
    difference = float(np.median(ordered[split:]) - np.median(ordered[:split]))
    return float((ordered[split - 1] + ordered[split]) / 2), difference


def _longest(chosen: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the longest run of true values, as its first index and the one after its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], chosen.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int(first), int(last)
