"""Figures over time: the last seconds of every channel with the marks in them, and the levels with their overloads."""

from collections.abc import Callable, Sequence

import numpy as np

from acquisition import Channel
from figures import COLOURS

from .control import Mark
from .drawing import GREEN, GREY, RED, Drawing, framed, number
from .monitor import Snapshot

FLOOR_DB = -80.0
_TOP_DB = 3.0


def traces(channels: Sequence[Channel], marks: Callable[[], Sequence[Mark]]) -> Drawing:
    """All channels above one another, each scaled to its own range in the window, which its label says; marks red."""
    from bokeh.models import ColumnDataSource

    n = len(channels)
    height = max(420, 20 * n)
    plot = framed(
        "Last seconds, each channel to its own range (beside it)", "Time since the start (s)", "", height=height
    )
    data = ColumnDataSource({"xs": [], "ys": [], "colour": []})
    plot.multi_line("xs", "ys", color="colour", source=data, line_width=1)
    set_marks = ColumnDataSource({"x": [], "y": [], "label": []})
    plot.vspan(x="x", source=set_marks, line_color=RED, line_dash="dashed")
    plot.text("x", "y", text="label", source=set_marks, text_color=RED, text_font_size="12px", x_offset=3)
    plot.yaxis.ticker = list(range(n))
    plot.y_range.start, plot.y_range.end = -0.7, n - 0.5 + max(0.3, 0.055 * n)  # room for the marks' notes
    plot.ygrid.visible = False

    def update(shown: Snapshot) -> None:
        some = len(shown.traces) > 0
        low = shown.traces.min(axis=0) if some else np.zeros(n)
        high = shown.traces.max(axis=0) if some else np.zeros(n)
        span = np.where(high > low, high - low, 1.0)
        scaled = 0.9 * (shown.traces - 0.5 * (low + high)) / span + np.arange(n - 1, -1, -1)
        data.data = {
            "xs": [shown.times.astype("f4")] * n,
            "ys": list(scaled.T.astype("f4")),
            "colour": [COLOURS[k % len(COLOURS)] for k in range(n)],
        }
        plot.yaxis.major_label_overrides = {
            n - 1 - k: f"{channel.name}  {number(low[k])} … {number(high[k])} {channel.unit}" if some else channel.name
            for k, channel in enumerate(channels)
        }
        inside = [mark for mark in marks() if some and shown.times[0] <= mark.shown_at <= shown.times[-1]]
        set_marks.data = {
            "x": [mark.shown_at for mark in inside],
            "y": [n - 0.5] * len(inside),
            "label": [mark.label for mark in inside],
        }

    return Drawing(plot, update)


def levels(channels: Sequence[Channel]) -> Drawing:
    """Peak of the last second against full scale, and whether a channel was ever overloaded."""
    from bokeh.models import ColumnDataSource

    names = [channel.name for channel in channels]
    scales = np.array([channel.full_scale or np.nan for channel in channels])
    plot = framed(
        "Peak of the last second; red: overloaded since the start",
        "Peak against full scale (dB)",
        "",
        y_range=names[::-1],
        x_range=(FLOOR_DB, _TOP_DB),
        height=max(420, 20 * len(names)),
    )
    data = ColumnDataSource({"name": names, "level": [FLOOR_DB] * len(names), "colour": [GREY] * len(names)})
    data.data["said"] = [""] * len(names)
    plot.hbar(y="name", left=FLOOR_DB, right="level", color="colour", height=0.8, alpha=0.75, source=data)
    plot.text(FLOOR_DB, "name", text="said", source=data, text_font_size="12px", text_baseline="middle", x_offset=6)

    def update(shown: Snapshot) -> None:
        with np.errstate(divide="ignore", invalid="ignore"):
            decibels = 20 * np.log10(shown.peaks / scales)
        over = shown.overloads > 0
        data.data = {
            "name": names,
            "level": np.clip(np.nan_to_num(decibels, nan=FLOOR_DB, neginf=FLOOR_DB), FLOOR_DB, _TOP_DB),
            "colour": np.where(over, RED, np.where(np.isnan(scales), GREY, GREEN)).tolist(),
            "said": [_said(c, shown.peaks[k], int(shown.overloads[k])) for k, c in enumerate(channels)],
        }

    return Drawing(plot, update)


def _said(channel: Channel, peak: float, overloads: int) -> str:
    """Peak in its unit, full scale, and how many samples were over."""
    whole = f" of {number(channel.full_scale)}" if channel.full_scale else ""
    over = f", {overloads} samples overloaded" if overloads else ""
    return f"{number(peak)}{whole} {channel.unit}{over}"
