"""Stability lobes: depth limit over spindle speed, the chatter frequency beneath, cuts that were tried."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from stability import StabilityLobes

from ..style import (
    COLOURS,
    SHADE,
    house_style,
    legend_above,
    legend_height,
    line_style,
    new_figure,
    panel_letter,
    place_panels,
)
from .islands import StableAbove, draw_stable_above

LIMITS = "limits"
"""Mark of the lines of depth limits, by which a further line finds its number and so its own colour."""


@dataclass(frozen=True)
class TriedCut:
    """A cut that was made, or simulated, and what was seen.

    Parameters
    ----------
    spindle_speed_rpm, depth
        rpm and m.
    kind
        ``stable``, ``hopf`` or ``period-doubling``.
    """

    spindle_speed_rpm: float
    depth: float
    kind: str


@dataclass(frozen=True)
class LobesBand:
    """Confidence interval of a depth limit over spindle speed.

    Parameters
    ----------
    spindle_speeds_rpm : (n_speeds,), rpm
        Spindle speeds of the limits.
    low, high : (n_speeds,), m
        Lower and upper end of the interval.
    """

    spindle_speeds_rpm: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def lobes_figure(
    curves: Mapping[str, StabilityLobes],
    cuts: Sequence[TriedCut] = (),
    band: LobesBand | None = None,
    stable_above: Sequence[StableAbove] = (),
) -> Figure:
    """Depth limits in mm over rpm, one line for each entry; the area above the first is shaded.

    Where a cut is stable at all depths asked for, the line is interrupted.

    Parameters
    ----------
    curves
        Lobes by the name in the legend.
    cuts
        Cuts that were made.
    band
        Confidence interval of the first lobes.
    stable_above
        Ranges of depth that are stable above an island of instability of the first lobes.
    """
    with house_style():
        figure = new_figure(115.0, None)
        depth, chatter = figure.subplots(2, 1, sharex=True, height_ratios=[1.9, 1.0], gridspec_kw={"hspace": 0.22})
        for number, (label, lobes) in enumerate(curves.items()):
            draw_limits(depth, lobes, label, number)
            _draw_chatter(chatter, lobes, number)
        _draw_cuts(depth, cuts)
        if band is not None:
            low, high = 1e3 * band.low, 1e3 * band.high
            depth.fill_between(
                band.spindle_speeds_rpm, low, high, color=COLOURS[1], alpha=0.3, linewidth=0, label="95 % interval"
            )
        top = max([depth_axis_top(list(curves.values()), cuts), *(1.05e3 * one.high for one in stable_above)])
        depth.set_ylim(0, top)
        if curves:
            first = next(iter(curves.values()))
            shade_unstable(depth, first, top)
            draw_stable_above(depth, stable_above, first.spindle_speeds_rpm.tolist())
        depth.set_ylabel("Axial depth limit (mm)")
        chatter.set_ylabel("Chatter\nfrequency (Hz)")
        chatter.set_xlabel("Spindle speed (rpm)")
        panel_letter(depth, 0)
        panel_letter(chatter, 1)
        place_panels(figure, left=19.0, top=legend_height(depth) + 5.0, right=5.0)
        legend_above(figure, depth)
    return figure


def draw_limits(axes: Axes, lobes: StabilityLobes, label: str, number: int) -> None:
    """Depth limits in mm over rpm, period doublings in a heavier line; ``number`` chooses colour and dashes."""
    rpm = lobes.spindle_speeds_rpm
    limit = np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, np.nan)
    axes.plot(rpm, limit, label=label, linewidth=_width(number), gid=LIMITS, **line_style(number))
    doubled = np.array([name == "period-doubling" for name in lobes.bifurcations], dtype=bool)
    if doubled.any():
        edge = np.where(doubled, limit, np.nan)
        axes.plot(rpm, edge, color=COLOURS[2], linewidth=2.4, zorder=3, label=f"{label}, period doubling")


def _draw_chatter(axes: Axes, lobes: StabilityLobes, number: int) -> None:
    frequencies = _without_jumps(lobes.chatter_frequencies)
    axes.plot(lobes.spindle_speeds_rpm, frequencies, linewidth=_width(number), **line_style(number))


def _width(number: int) -> float:
    return 1.6 if number == 0 else 1.2


def _without_jumps(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Break the line where one lobe ends and the next begins at another frequency."""
    broken = frequency.copy()
    broken[1:][np.abs(np.diff(frequency)) > 0.02 * np.abs(frequency[1:])] = np.nan
    return broken


def shade_unstable(axes: Axes, lobes: StabilityLobes, top: float) -> None:
    """Grey above the limits, up to ``top`` (mm)."""
    limit = np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, top)
    rpm = lobes.spindle_speeds_rpm
    axes.fill_between(rpm, np.minimum(limit, top), top, color=SHADE, linewidth=0, zorder=0, label="unstable")
    axes.set_xlim(float(rpm.min()), float(rpm.max()))


_MARKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("stable", "cut, stable", {"marker": "o", "markerfacecolor": "white"}),
    ("hopf", "cut, Hopf chatter", {"marker": "X", "markeredgecolor": "white"}),
    ("period-doubling", "cut, period doubling", {"marker": "s", "markeredgecolor": "white"}),
)


def _draw_cuts(axes: Axes, cuts: Sequence[TriedCut]) -> None:
    for kind, label, marks in _MARKS:
        chosen = [cut for cut in cuts if cut.kind == kind]
        if chosen:
            rpm, depths = [cut.spindle_speed_rpm for cut in chosen], [1e3 * cut.depth for cut in chosen]
            axes.plot(rpm, depths, linestyle="none", color="black", markersize=6, label=label, zorder=5, **marks)


def depth_axis_top(curves: Sequence[StabilityLobes], cuts: Sequence[TriedCut] = ()) -> float:
    """Upper end of an axis of depths (mm): above nearly all limits and above every cut that was tried."""
    finite = np.concatenate(
        [1e3 * lobes.depth_limits[np.isfinite(lobes.depth_limits)] for lobes in curves]
        + [np.array([1e3 * cut.depth for cut in cuts])]
    )
    if not len(finite):
        return 1.0
    return 1.2 * float(max(np.percentile(finite, 97), max((1e3 * cut.depth for cut in cuts), default=0.0)))
