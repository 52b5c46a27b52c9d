"""Does the residual sit at multiples of the spindle's speed?"""

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
"""Lines of a block on either side of an order that belong to it."""


@dataclass(frozen=True)
class SpindleSpeed:
    """Speed over time as a recording states it.

    Parameters
    ----------
    time : (n,), s
    rpm : (n,)
    """

    time: Real
    rpm: Real

    def hertz(self, start: float, stop: float) -> tuple[float, float]:
        """Mean rotations a second between two times, and their change there."""
        at = np.interp(np.linspace(start, stop, 9), self.time, self.rpm) / 60
        return float(at.mean()), float(np.ptp(at))


def spindle_speed(path: str | os.PathLike[str]) -> SpindleSpeed | None:
    """Speed from a recording's events, or a constant one from its set-up; None where it states none."""
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
    """Residual power at each order and beside it, and the independent lines that carry it, each (MOST_ORDERS,).

    Blocks in which the speed changes by more than the resolution at an order are left out there; "beside" are the
    lines midway between neighbouring orders.
    """
    step = float(blocks.frequencies[1] - blocks.frequencies[0])
    sums = np.zeros((3, MOST_ORDERS))
    for row, start, stop in zip(blocks.power, blocks.times[:-1], blocks.times[1:], strict=True):
        rotation, change = speed.hertz(float(start), float(stop))
        if rotation < 4 * NEAR * step:
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
