"""Depths that are stable again above the lowest limit: an island of instability lies below them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from ..style import COLOURS


@dataclass(frozen=True)
class StableAbove:
    """A range of depths at one speed that is stable, with unstable depths beneath it.

    Parameters
    ----------
    spindle_speed_rpm : rpm
        Spindle speed at which that was found.
    low, high : m
        Lower and upper end of the range.
    """

    spindle_speed_rpm: float
    low: float
    high: float


def draw_stable_above(axes: Axes, ranges: Sequence[StableAbove], speeds_rpm: Sequence[float]) -> None:
    """White fields with a hatch, as wide as the steps between the speeds that were looked at.

    Parameters
    ----------
    axes
        Axes of depth (mm) over speed (rpm), the unstable side shaded.
    ranges
        Ranges that are stable.
    speeds_rpm
        All speeds that were looked at, increasing.
    """
    grid = np.asarray(speeds_rpm, dtype=float)
    edges = np.concatenate([grid[:1], (grid[1:] + grid[:-1]) / 2, grid[-1:]])
    for number, one in enumerate(ranges):
        k = int(np.argmin(np.abs(grid - one.spindle_speed_rpm)))
        corner, width, height = (edges[k], 1e3 * one.low), edges[k + 1] - edges[k], 1e3 * (one.high - one.low)
        label = "stable above an island" if number == 0 else None
        field = Rectangle(corner, width, height, facecolor="white", edgecolor=COLOURS[3], linewidth=0.0)
        field.set(hatch="////", zorder=0.5, label=label)
        axes.add_patch(field)
