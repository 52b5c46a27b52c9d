"""What differs from revolution to revolution in a window of a running cut, compared with the stable cut before it."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from millfrf.core import Real

from ..settings import THRESHOLDS


@dataclass(frozen=True)
class Unrepeated:
    """Motion that differs from revolution to revolution."""

    size: float  # logarithm of its size, see :func:`size_of`
    share: float  # its size over that of all motion


def size_of(samples: Real) -> float:
    """Return the logarithm of the geometric mean of the standard deviations of all channels that move."""
    sizes = samples.std(axis=0)
    return float(np.log(sizes[sizes > 0]).mean()) if (sizes > 0).any() else math.log(1e-300)


def unrepeated_of(turns: Real) -> Unrepeated:
    """Return what differs from the mean revolution, in the median of five parts of the window.

    ``turns`` is (n_revolutions, n_places, n_channels). A part is short, so that an entry into the cut counts little.
    """
    parts = np.array_split(turns, 5)
    residuals = [(part - part.mean(axis=0)).reshape(-1, part.shape[2]) for part in parts]
    sizes = np.array([size_of(residual) for residual in residuals])
    whole = np.array([size_of(part.reshape(-1, part.shape[2])) for part in parts])
    return Unrepeated(float(np.median(sizes)), float(np.exp(np.median(sizes - whole))))


def change_of(turns: Real) -> Unrepeated:
    """Return the change from each revolution to the next, over the root of two."""
    change = (np.diff(turns, axis=0) / math.sqrt(2)).reshape(-1, turns.shape[2])
    size = size_of(change)
    return Unrepeated(size, math.exp(size - size_of(turns.reshape(-1, turns.shape[2]))))


def enters(turns: Real) -> bool:
    """Check whether the orders of the spindle grow or fall within a window, and all other motion with them.

    While a tool enters or leaves a cut, lines grow or fall with the orders; chatter grows beyond them.
    """
    count = max(len(turns) // 5, 2)
    first, last = turns[:count], turns[-count:]
    of_orders = size_of(last.mean(axis=0)) - size_of(first.mean(axis=0))
    of_all = size_of(last.reshape(-1, last.shape[2])) - size_of(first.reshape(-1, first.shape[2]))
    beyond = math.log(THRESHOLDS.online_growth)
    return abs(of_orders) > beyond and of_all - max(of_orders, 0.0) < beyond / 2


class StableCut:
    """Sizes of the motion that does not repeat in the last windows that were stable."""

    def __init__(self) -> None:
        self._sizes: deque[float] = deque(maxlen=THRESHOLDS.online_stable)

    def append(self, now: Unrepeated) -> None:
        """Add a stable window."""
        self._sizes.append(now.size)

    def rise(self, now: Unrepeated) -> float:
        """Return a size over the largest of the stable cut; 1 while that is too short.

        In real cuts these sizes vary by half from window to window and are single bursts at times, so that their mean
        says little.
        """
        if len(self._sizes) < THRESHOLDS.online_open:
            return 1.0
        return math.exp(now.size - max(self._sizes))

    @staticmethod
    def reason(now: Unrepeated, rise: float) -> str:
        """Say how much of the motion does not repeat."""
        part = f"{100 * now.share:.0f} % of the motion does not repeat"
        return f"{part}, {rise:.1f} times as much as at any time in the stable cut before"
