"""Residual power at multiples of the spindle's speed."""

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording

from .time_maps import BlockResidual

Real = NDArray[np.float64]

SPEED = "spindle_speed_rpm"
MOST_ORDERS = 24
NEAR = 1.5
"""Distance from an order within which lines belong to it, in spacings of a block's lines."""
LONGEST_GAP, USUAL_GAPS = 2.0, 20.0
"""A gap between two statements of the speed longer than this, in s and in median gaps, is a device that was lost."""


@dataclass(frozen=True)
class SpindleSpeed:
    """Speed of the spindle over time as a recording states it.

    Parameters
    ----------
    time : (n,), s
        Times at which the speed is stated, from the beginning of the recording.
    rpm : (n,)
        Speed at these times, revolutions a minute.
    """

    time: Real
    rpm: Real

    def hertz(self, start: float, stop: float) -> tuple[float, float]:
        """Return the mean speed between two times, and its range there, revolutions a second.

        Both are NaN where nobody stated the speed for so long that its device must have been lost.
        """
        steps = np.diff(self.time)
        if len(steps) and self._lost(steps, start, stop):
            return float("nan"), float("nan")
        at = np.interp(np.linspace(start, stop, 9), self.time, self.rpm) / 60
        return float(at.mean()), float(np.ptp(at))

    def _lost(self, steps: Real, start: float, stop: float) -> bool:
        """Whether a gap between two statements, longer than all usual ones, reaches into the stretch of time."""
        gaps = steps > max(LONGEST_GAP, USUAL_GAPS * float(np.median(steps)))
        return bool((gaps & (self.time[:-1] < stop) & (self.time[1:] > start)).any())


def spindle_speed(path: str | os.PathLike[str]) -> SpindleSpeed | None:
    """Return the speed from a recording's events, or a constant one from its set-up; None where neither states one."""
    with Recording(Path(path)) as recording:
        if SPEED in recording.events:
            time, rpm = recording.events[SPEED].read()
            good = np.isfinite(time) & np.isfinite(rpm)
            if good.any():
                return SpindleSpeed(time[good], rpm[good])
        setup = recording.setup
    try:
        tables = [table for table in tomllib.loads(setup).values() if isinstance(table, dict)]
    except tomllib.TOMLDecodeError:
        return None
    for table in tables:
        stated = table.get(SPEED)
        if isinstance(stated, int | float) and table.get("speed_profile", "constant") == "constant":
            return SpindleSpeed(np.zeros(1), np.array([float(stated)]))
    return None


def order_powers(blocks: BlockResidual, speed: SpindleSpeed) -> tuple[Real, Real, Real]:
    """Return the residual power at each order, that beside it, and the independent lines, each (MOST_ORDERS,).

    An order leaves out the blocks in which the speed moves it by more than the resolution. The lines midway between
    neighbouring orders lie "beside" them.
    """
    step = float(blocks.frequencies[1] - blocks.frequencies[0])
    sums = np.zeros((3, MOST_ORDERS))
    for row, start, stop in zip(blocks.power, blocks.times[:-1], blocks.times[1:], strict=True):
        rotation, change = speed.hertz(float(start), float(stop))
        if not rotation >= 4 * NEAR * step:  # too slow, or unknown (NaN)
            continue
        for k in range(MOST_ORDERS):
            order = k + 1
            if order * change > 2 * NEAR * step:
                break
            on = np.abs(blocks.frequencies - order * rotation) <= NEAR * step
            off = np.abs(np.abs(blocks.frequencies - order * rotation) - rotation / 2) <= NEAR * step
            if on.any() and off.any():
                sums[:, k] += row[on].sum(), row[off].mean() * on.sum(), on.sum()
    held = np.maximum(sums[2], 1)
    return sums[0] / held, sums[1] / held, sums[2] * blocks.channels / blocks.overlap
