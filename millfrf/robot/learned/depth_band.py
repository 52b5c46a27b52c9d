"""The band of depth limits in a posture that was not measured: limits of modal models that were drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import lowest_limits
from modal_fit import ModalModel

Real = NDArray[np.float64]

SAMPLES = 79
"""Between the second smallest and the second largest of 79 limits the next one lies with 76 / 80 = 95 %."""


@dataclass(frozen=True)
class DepthBand:
    """95 % band of the depth limit at each speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    low, middle, high : (n_speeds,), m
        Ends of the band and median of the draws; ``max_depth`` where the limit lies above it.
    max_depth : m
        Largest depth that was looked at.
    """

    spindle_speeds: Real
    low: Real
    middle: Real
    high: Real
    max_depth: float


def depth_band(
    draws: Sequence[ModalModel],
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    samples: int = SAMPLES,
    progress: Callable[[int], None] | None = None,
) -> DepthBand:
    """Solve the depth limits of drawn models, time-periodic and converged, and order them.

    Parameters
    ----------
    draws
        Modal models of the prediction; ``samples`` of them are taken at equal steps.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the wanted limits.
    max_depth : m
        Largest depth that is looked at.
    samples
        Number of models; the band leaves ``round(0.025 (n + 1))`` limits out at either end, itself included.
    progress
        Function that is told how many models are done.
    """
    chosen = np.linspace(0, len(draws) - 1, min(samples, len(draws))).astype(int)
    limits = np.empty((len(chosen), len(spindle_speeds)))
    for row, index in enumerate(chosen):
        found = lowest_limits(draws[index], process, spindle_speeds, max_depth).lowest()
        unresolved = np.array([status == "unresolved" for status in found.status])
        limits[row] = np.where(unresolved, 0.0, np.minimum(found.depth_limits, max_depth))
        if progress is not None:
            progress(row + 1)
    ordered = np.sort(limits, axis=0)
    end = max(round(0.025 * (len(chosen) + 1)), 1)
    return DepthBand(np.asarray(spindle_speeds), ordered[end - 1], np.median(ordered, axis=0), ordered[-end], max_depth)
