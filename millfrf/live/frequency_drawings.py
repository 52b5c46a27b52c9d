"""Figures over frequency: spectra with the tooth-passing lines, FRF, coherence, and whether there is enough data."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from acquisition import Channel
from estimation import Frf
from figures import COLOURS

from .drawing import GREEN, GREY, RED, Drawing, framed, number, thinned
from .monitor import Snapshot

FREQUENCY = "Frequency (Hz)"
_HARMONICS = 3
_TINY = 1e-30
_COLOUR = COLOURS[1]

Kind = Literal["magnitude", "phase", "coherence"]


def spectrum(channels: Sequence[Channel], chosen: Callable[[], Sequence[str]]) -> Drawing:
    """Roots of the power spectral densities of chosen channels, with the tooth-passing frequency and its harmonics."""
    from bokeh.models import ColumnDataSource, Span

    plot = framed("Spectra", FREQUENCY, "Amplitude density (unit/√Hz)", y_axis_type="log")
    data = ColumnDataSource({"xs": [], "ys": [], "colour": [], "name": []})
    plot.multi_line("xs", "ys", color="colour", legend_field="name", source=data)
    plot.add_layout(plot.legend[0], "right")
    teeth = [Span(location=0, dimension="height", line_dash="dashed", line_color=GREY) for _ in range(_HARMONICS)]
    for span in teeth:
        span.visible = False
        plot.add_layout(span)
    units = {channel.name: channel.unit for channel in channels}

    def update(shown: Snapshot) -> None:
        known = shown.tooth_passing > 0
        plot.title.text = f"Spectra; dashed: tooth passing {number(shown.tooth_passing)} Hz" if known else "Spectra"
        for order, span in enumerate(teeth, 1):
            span.location, span.visible = order * shown.tooth_passing, known
        if shown.spectra is None:
            data.data = {"xs": [], "ys": [], "colour": [], "name": []}
            return
        wanted = [name for name in chosen() if name in shown.spectra.channels]
        density = np.sqrt(shown.spectra.power)
        kept = thinned(len(density))
        columns = [shown.spectra.channels.index(name) for name in wanted]
        data.data = {
            "xs": [shown.spectra.frequencies[kept]] * len(wanted),
            "ys": [np.maximum(density[kept, k], _TINY) for k in columns],
            "colour": [COLOURS[k % len(COLOURS)] for k in range(len(wanted))],
            "name": [f"{name} ({units[name]})" for name in wanted],
        }

    return Drawing(plot, update)


def transfer(kind: Kind, chosen: Callable[[], tuple[int, int]]) -> Drawing:
    """An entry of the FRF (magnitude with two standard deviations, or phase), or its response's multiple coherence."""
    from bokeh.models import ColumnDataSource, FixedTicker

    label = {"magnitude": "Magnitude", "phase": "Phase (°)", "coherence": "Multiple coherence"}[kind]
    plot = framed(label, FREQUENCY, label, y_axis_type="log" if kind == "magnitude" else "linear")
    data = ColumnDataSource({"x": [], "y": [], "low": [], "high": []})
    if kind == "magnitude":
        plot.varea("x", "low", "high", source=data, fill_alpha=0.25, fill_color=_COLOUR)
    line = plot.line("x", "y", source=data, color=_COLOUR)
    if kind == "magnitude":
        plot.y_range.renderers = [line]  # where nothing is known yet, the band would squeeze the curve flat
    elif kind == "phase":
        plot.y_range.start, plot.y_range.end = -190.0, 190.0
        plot.yaxis.ticker = FixedTicker(ticks=[-180, -90, 0, 90, 180])
    else:
        plot.y_range.start, plot.y_range.end = 0.0, 1.05

    def update(shown: Snapshot) -> None:
        frf = None if shown.spectra is None else shown.spectra.frf
        if frf is None or shown.spectra is None:
            data.data = {"x": [], "y": [], "low": [], "high": []}
            return
        response, excitation = chosen()
        entry = f"{frf.responses[response]} / {frf.excitations[excitation]}"
        plot.title.text = {
            "magnitude": f"FRF {entry}; band: two standard deviations",
            "phase": f"Phase of the FRF {entry}",
            "coherence": f"Multiple coherence of {frf.responses[response]}",
        }[kind]
        if kind == "magnitude":
            plot.yaxis.axis_label = f"Magnitude ({frf.unit})"
        data.data = _curve(frf, kind, response, excitation, float(shown.spectra.frequencies[-1]))

    return Drawing(plot, update)


def _curve(frf: Frf, kind: Kind, response: int, excitation: int, highest: float) -> dict[str, Any]:
    inside = np.flatnonzero(frf.valid & (frf.frequencies > 0) & (frf.frequencies <= highest))
    inside = inside[thinned(len(inside))]
    frequencies, entry = frf.frequencies[inside], frf.values[inside, response, excitation]
    if kind == "magnitude":
        size, variance = np.abs(entry), 0.0
        if frf.covariance is not None:
            variance = frf.covariance.variance()[inside, response, excitation]
        error = 2 * np.sqrt(variance)
        low, high = np.maximum(size - error, 1e-3 * size + _TINY), size + error + _TINY
        return {"x": frequencies, "y": size + _TINY, "low": low, "high": high}
    if kind == "phase":
        value = np.degrees(np.angle(entry))
    else:
        known = frf.multiple_coherence is not None
        value = frf.multiple_coherence[inside, response] if known else np.zeros(len(inside))  # type: ignore[index]
    return {"x": frequencies, "y": value, "low": value, "high": value}


def enough() -> Drawing:
    """Share of the data that each band needs for the planned error of its FRF."""
    from bokeh.models import ColumnDataSource

    plot = framed("Enough data? Green: yes", "Share of the averages that the planned error needs", FREQUENCY)
    plot.x_range.start, plot.x_range.end = 0.0, 1.02
    data = ColumnDataSource({"low": [], "high": [], "middle": [], "share": [], "colour": [], "said": []})
    plot.quad(*(0, "share"), "high", "low", color="colour", line_color="white", alpha=0.75, source=data)
    plot.text(0, "middle", text="said", source=data, text_font_size="12px", text_baseline="middle", x_offset=6)

    def update(shown: Snapshot) -> None:
        data.data = {
            "low": [band.low for band in shown.bands],
            "high": [band.high for band in shown.bands],
            "middle": [0.5 * (band.low + band.high) for band in shown.bands],
            "share": [max(band.done, 0.005) for band in shown.bands],
            "colour": [GREEN if band.enough else RED for band in shown.bands],
            "said": [_progress(band.error, band.share) for band in shown.bands],
        }

    return Drawing(plot, update)


def _progress(error: float, share: float) -> str:
    """The error in terms of the wanted one, and how many lines have reached it."""
    return f"error {number(error)} × planned, {100 * share:.0f} % of lines done" if np.isfinite(error) else "no FRF yet"
