"""Stability lobes that zoom: each speed tells its depth limit, chatter frequency and status."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stability import StabilityLobes

from ..cuts import LobesBand, StableAbove, depth_axis_top
from ..style import COLOURS, SHADE
from .framed import framed, hover, legend_above, look, shared_range
from .plot import ZoomedPlot, as_plot


def zoomed_limits(
    curves: Mapping[str, StabilityLobes], band: LobesBand | None = None, stable_above: Sequence[StableAbove] = ()
) -> ZoomedPlot:
    """Depth limits in mm over rpm, and the chatter frequency beneath.

    Parameters
    ----------
    curves
        Lobes by the name in the legend; the first one's unstable side is shaded.
    band
        Confidence interval of the first.
    stable_above
        Ranges of depth that are stable above an island of instability of the first.
    """
    from bokeh.layouts import column

    first = next(iter(curves.values()))
    rpm = first.spindle_speeds_rpm
    speeds = shared_range((float(rpm.min()), float(rpm.max())), "spindle speed")
    top = max([depth_axis_top(list(curves.values())), *(1.05e3 * one.high for one in stable_above)])
    depth = framed("", "Axial depth limit (mm)", speeds, 340, y_range=(0.0, top))
    chatter = framed("Spindle speed (rpm)", "Chatter frequency (Hz)", speeds, 200)
    limit = np.where(np.isfinite(first.depth_limits), 1e3 * first.depth_limits, 1e3)
    depth.varea(rpm, np.minimum(limit, 1e3), np.full(len(rpm), 1e3), fill_color=SHADE, legend_label="unstable")
    if stable_above:
        _draw_ranges(depth, stable_above, rpm)
    if band is not None:
        shade: dict[str, Any] = {"fill_color": COLOURS[1], "fill_alpha": 0.3, "legend_label": "95 % interval"}
        depth.varea(band.spindle_speeds_rpm, 1e3 * band.low, 1e3 * np.minimum(band.high, 1.0), **shade)
    for number, (name, lobes) in enumerate(curves.items()):
        source = _source(lobes)
        told = [
            (name, ""),
            ("spindle speed", "@rpm{0} rpm"),
            ("depth limit", "@depth{0.000} mm"),
            ("chatter", "@chatter{0.00} Hz, @kind"),
            ("status", "@status"),
        ]
        line = depth.line("rpm", "depth", source=source, legend_label=name, line_width=2, **look(number))
        hover(depth, [line], told)
        hover(
            chatter, [chatter.scatter("rpm", "chatter", source=source, size=3, color=look(number)["line_color"])], told
        )
    legend_above(depth)
    return as_plot(column(depth, chatter, sizing_mode="stretch_width"))


def _draw_ranges(depth: Any, ranges: Sequence[StableAbove], rpm: NDArray[np.float64]) -> None:
    """White fields, as wide as the steps of speed."""
    from bokeh.models import ColumnDataSource

    middle = [one.spindle_speed_rpm for one in ranges]
    low, high = [1e3 * one.low for one in ranges], [1e3 * one.high for one in ranges]
    source = ColumnDataSource({"rpm": middle, "low": low, "high": high})
    wide = float(np.median(np.diff(rpm)))
    white: dict[str, Any] = {
        "fill_color": "#ffffff",
        "line_color": COLOURS[3],
        "legend_label": "stable above an island",
    }
    drawn = depth.vbar(x="rpm", width=wide, bottom="low", top="high", source=source, **white)
    hover(depth, [drawn], [("stable again", "@low{0.00} to @high{0.00} mm"), ("spindle speed", "@rpm{0} rpm")])


def _source(lobes: StabilityLobes) -> Any:
    from bokeh.models import ColumnDataSource

    return ColumnDataSource(
        {
            "rpm": lobes.spindle_speeds_rpm,
            "depth": np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, np.nan),
            "chatter": lobes.chatter_frequencies,
            "kind": list(lobes.bifurcations),
            "status": list(lobes.status),
        }
    )
