"""Figures over time: the last seconds of every channel with the marks in them, and the levels with their overloads."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from acquisition import Channel
from millfrf.figures import COLOURS

from ..control import Mark
from ..monitor import Snapshot
from .drawing import GREEN, GREY, RED, Choice, Content, Drawing, framed, number, plain, unit_text

FLOOR_DB = -80.0
_TOP_DB = 3.0


def traces(channels: Sequence[Channel]) -> Drawing:
    """All channels above one another, each scaled to its own range in the window, which its label says; marks red."""
    from bokeh.models import ColumnDataSource

    n = len(channels)
    plot = framed("traces", "Last seconds, each channel over its own range", "Time since the start (s)", "")
    plot.height = max(420, 20 * n)
    data = ColumnDataSource({"xs": [], "ys": [], "colour": []}, name="traces.data")
    plot.multi_line("xs", "ys", color="colour", source=data, line_width=1)
    set_marks = ColumnDataSource({"x": [], "y": [], "label": []}, name="marks")
    plot.vspan(x="x", source=set_marks, line_color=RED, line_dash="dashed")
    plot.text("x", "y", text="label", source=set_marks, text_color=RED, text_font_size="12px", x_offset=3)
    plot.yaxis.ticker = list(range(n))
    plot.y_range.start, plot.y_range.end = -0.7, n - 0.5 + max(0.3, 0.055 * n)  # room for the marks' notes
    plot.ygrid.visible = False
    names = [plain(channel.name) for channel in channels]
    units = [unit_text(channel.unit) for channel in channels]

    def content(shown: Snapshot, _: Choice, marks: Sequence[Mark]) -> Content:
        if not len(shown.traces):
            empty: dict[str, Any] = {
                "traces": {"xs": [], "ys": [], "colour": []},
                "marks": {"x": [], "y": [], "label": []},
            }
            return {"sources": empty, "ticks": {n - 1 - k: name for k, name in enumerate(names)}}
        low, high = shown.traces.min(axis=0), shown.traces.max(axis=0)
        span = np.where(high > low, high - low, 1.0)
        scaled = 0.9 * (shown.traces - 0.5 * (low + high)) / span + np.arange(n - 1, -1, -1)
        inside = [mark for mark in marks if shown.times[0] <= mark.shown_at <= shown.times[-1]]
        lines = {"x_of_all": shown.times, "ys": list(scaled.T), "colour": [COLOURS[k % len(COLOURS)] for k in range(n)]}
        labels = {
            "x": [mark.shown_at for mark in inside],
            "y": [n - 0.5] * len(inside),
            "label": [plain(mark.label) for mark in inside],
        }
        ticks = {n - 1 - k: f"{name}  {number(low[k])} … {number(high[k])} {units[k]}" for k, name in enumerate(names)}
        return {"sources": {"traces.data": lines, "marks": labels}, "ticks": ticks}

    return Drawing("traces", plot, content)


def levels(channels: Sequence[Channel]) -> Drawing:
    """Peak of the last second against full scale, and whether a channel was ever overloaded."""
    from bokeh.models import ColumnDataSource

    n = len(channels)
    names = [plain(channel.name) for channel in channels]
    scales = np.array([channel.full_scale or np.nan for channel in channels])
    title = "Peak of the last second; red: overloaded since the start"
    plot = framed("levels", title, "Peak against full scale (dB)", "", x_range=(FLOOR_DB, _TOP_DB))
    plot.height = max(420, 20 * n)
    plot.y_range.start, plot.y_range.end = -0.7, n - 0.3
    plot.yaxis.ticker = list(range(n))
    plot.yaxis.major_label_overrides = {n - 1 - k: name for k, name in enumerate(names)}
    plot.ygrid.visible = False
    data = ColumnDataSource({"y": [], "level": [], "colour": [], "said": []}, name="levels.data")
    plot.hbar(y="y", left=FLOOR_DB, right="level", color="colour", height=0.8, alpha=0.75, source=data)
    plot.text(FLOOR_DB, "y", text="said", source=data, text_font_size="12px", text_baseline="middle", x_offset=6)

    def content(shown: Snapshot, _: Choice, __: Sequence[Mark]) -> Content:
        with np.errstate(divide="ignore", invalid="ignore"):
            decibels = 20 * np.log10(shown.peaks / scales)
        over = shown.overloads > 0
        columns = {
            "y": list(range(n - 1, -1, -1)),
            "level": np.clip(np.nan_to_num(decibels, nan=FLOOR_DB, neginf=FLOOR_DB), FLOOR_DB, _TOP_DB),
            "colour": np.where(over, RED, np.where(np.isnan(scales), GREY, GREEN)).tolist(),
            "said": [_said(c, shown.peaks[k], int(shown.overloads[k])) for k, c in enumerate(channels)],
        }
        return {"sources": {"levels.data": columns}}

    return Drawing("levels", plot, content)


def _said(channel: Channel, peak: float, overloads: int) -> str:
    """Peak in its unit, full scale, and how many samples were over."""
    whole = f" of {number(channel.full_scale)}" if channel.full_scale else ""
    over = f", {overloads} samples overloaded" if overloads else ""
    return f"{number(peak)}{whole} {unit_text(channel.unit)}{over}"
