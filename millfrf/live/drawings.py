"""The page's figures: each is made once and then fed with snapshots."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition import Channel
from estimation import Frf

from ..figures.style import COLOURS
from .monitor import Snapshot

FLOOR_DB = -80.0
GREEN, RED, GREY = "#009E73", "#D55E00", "#999999"
_MOST_LINES = 4000


@dataclass(frozen=True)
class Drawing:
    """A figure and how it takes a snapshot.

    Parameters
    ----------
    figure
        For the layout.
    update
        Called in the page's own thread.
    """

    figure: Any
    update: Callable[[Snapshot], None]


def traces(channels: Sequence[Channel]) -> Drawing:
    """All channels above one another, each scaled to its own largest value in the window."""
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure

    n = len(channels)
    plot = figure(title="Last seconds, each channel to its own scale", x_axis_label="s", height=420, tools="")
    plot.toolbar.logo = None
    data = ColumnDataSource({"xs": [], "ys": [], "colour": []})
    plot.multi_line("xs", "ys", color="colour", source=data, line_width=1)
    plot.yaxis.ticker = list(range(n))
    plot.yaxis.major_label_overrides = {n - 1 - k: channel.name for k, channel in enumerate(channels)}
    plot.ygrid.visible = False

    def update(shown: Snapshot) -> None:
        middle = 0.5 * (shown.traces.max(axis=0) + shown.traces.min(axis=0)) if len(shown.traces) else 0.0
        span = np.ptp(shown.traces, axis=0) if len(shown.traces) else np.ones(n)
        scaled = 0.9 * (shown.traces - middle) / np.where(span > 0, span, 1.0) + np.arange(n - 1, -1, -1)
        data.data = {
            "xs": [shown.times.astype("f4")] * n,
            "ys": list(scaled.T.astype("f4")),
            "colour": [COLOURS[k % len(COLOURS)] for k in range(n)],
        }

    return Drawing(plot, update)


def levels(channels: Sequence[Channel]) -> Drawing:
    """Peak of the last second below full scale, and whether a channel was ever overloaded."""
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure

    names = [channel.name for channel in channels]
    scales = np.array([channel.full_scale or np.nan for channel in channels])
    plot = figure(
        title="Peak below full scale (dB); red: overloaded since the start",
        y_range=names[::-1],
        x_range=(FLOOR_DB, 3),
        height=420,
        tools="",
    )
    plot.toolbar.logo = None
    data = ColumnDataSource({"name": names, "level": [FLOOR_DB] * len(names), "colour": [GREY] * len(names)})
    plot.hbar(y="name", left=FLOOR_DB, right="level", color="colour", height=0.8, source=data)

    def update(shown: Snapshot) -> None:
        with np.errstate(divide="ignore", invalid="ignore"):
            decibels = 20 * np.log10(shown.peaks / scales)
        level = np.clip(np.nan_to_num(decibels, nan=FLOOR_DB, neginf=FLOOR_DB), FLOOR_DB, 3)
        colour = [
            RED if over else GREY if np.isnan(s) else GREEN for over, s in zip(shown.overloads, scales, strict=True)
        ]
        data.data = {"name": names, "level": level, "colour": colour}

    return Drawing(plot, update)


def spectrum(chosen: Callable[[], Sequence[str]]) -> Drawing:
    """Root of the power spectral densities of chosen channels, with the tooth-passing frequency and its harmonics."""
    from bokeh.models import ColumnDataSource, Span
    from bokeh.plotting import figure

    plot = figure(title="Spectrum (unit/sqrt Hz); dashed: tooth passing", y_axis_type="log", height=300, tools="")
    plot.xaxis.axis_label = "Hz"
    plot.toolbar.logo = None
    data = ColumnDataSource({"xs": [], "ys": [], "colour": [], "name": []})
    plot.multi_line("xs", "ys", color="colour", legend_field="name", source=data)
    plot.add_layout(plot.legend[0], "right")
    teeth = [Span(location=0, dimension="height", line_dash="dashed", line_color=GREY) for _ in range(3)]
    for span in teeth:
        span.visible = False
        plot.add_layout(span)

    def update(shown: Snapshot) -> None:
        for order, span in enumerate(teeth, 1):
            span.location, span.visible = order * shown.tooth_passing, shown.tooth_passing > 0
        if shown.spectra is None:
            data.data = {"xs": [], "ys": [], "colour": [], "name": []}
            return
        wanted = [name for name in chosen() if name in shown.spectra.channels]
        density = np.sqrt(shown.spectra.power)
        kept = _thinned(len(density))
        columns = [shown.spectra.channels.index(name) for name in wanted]
        data.data = {
            "xs": [shown.spectra.frequencies[kept]] * len(wanted),
            "ys": [np.maximum(density[kept, k], 1e-30) for k in columns],
            "colour": [COLOURS[k % len(COLOURS)] for k in range(len(wanted))],
            "name": wanted,
        }

    return Drawing(plot, update)


def transfer(kind: str, chosen: Callable[[], tuple[int, int]]) -> Drawing:
    """``frf``: magnitude of an entry with two standard deviations; ``coherence``: the multiple one of its response."""
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure

    log = kind == "frf"
    title = "FRF magnitude with two standard deviations" if log else "Multiple coherence"
    plot = figure(title=title, y_axis_type="log" if log else "linear", height=300, tools="")
    plot.xaxis.axis_label = "Hz"
    plot.toolbar.logo = None
    if not log:
        plot.y_range.start, plot.y_range.end = 0.0, 1.05
    data = ColumnDataSource({"x": [], "y": [], "low": [], "high": []})
    if log:
        plot.varea("x", "low", "high", source=data, fill_alpha=0.25, fill_color=COLOURS[1])
    plot.line("x", "y", source=data, color=COLOURS[1])

    def update(shown: Snapshot) -> None:
        frf = None if shown.spectra is None else shown.spectra.frf
        if frf is None:
            data.data = {"x": [], "y": [], "low": [], "high": []}
            return
        data.data = _curve(frf, kind, *chosen(), float(shown.spectra.frequencies[-1]) if shown.spectra else 0.0)

    return Drawing(plot, update)


def _curve(frf: Frf, kind: str, response: int, excitation: int, highest: float) -> dict[str, Any]:
    inside = np.flatnonzero(frf.valid & (frf.frequencies > 0) & (frf.frequencies <= highest))
    inside = inside[_thinned(len(inside))]
    frequencies = frf.frequencies[inside]
    if kind == "coherence" and frf.multiple_coherence is not None:
        value = frf.multiple_coherence[inside, response]
        return {"x": frequencies, "y": value, "low": value, "high": value}
    size = np.abs(frf.values[inside, response, excitation])
    error = 0 * size if frf.covariance is None else 2 * np.sqrt(frf.covariance.variance()[inside, response, excitation])
    tiny = 1e-30
    low, high = np.maximum(size - error, 1e-3 * size + tiny), size + error + tiny
    return {"x": frequencies, "y": size + tiny, "low": low, "high": high}


def enough() -> Drawing:
    """Share of the data that each band needs for the planned error of its FRF."""
    from bokeh.models import ColumnDataSource
    from bokeh.plotting import figure

    plot = figure(
        title="Enough data? Share of what the planned error needs",
        x_range=(0, 1),
        height=300,
        tools="",
    )
    plot.yaxis.axis_label = "Hz"
    plot.toolbar.logo = None
    data = ColumnDataSource({"low": [], "high": [], "share": [], "colour": []})
    plot.quad(left=0, right="share", bottom="low", top="high", color="colour", line_color="white", source=data)

    def update(shown: Snapshot) -> None:
        data.data = {
            "low": [band.low for band in shown.bands],
            "high": [band.high for band in shown.bands],
            "share": [max(band.done, 0.005) for band in shown.bands],
            "colour": [GREEN if band.enough else RED for band in shown.bands],
        }

    return Drawing(plot, update)


def _thinned(n: int) -> slice:
    """Every how-manyeth line is drawn."""
    return slice(None, None, max(1, n // _MOST_LINES))
