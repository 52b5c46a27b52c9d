"""Interactive figures for HTML pages, drawn by bokeh."""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError
from modal_fit import ComplexModeIndicator, ModalModel, MultivariateModeIndicator, StabilisationChart, Synthesis

from .style import COLOURS, FITTED

DASHES = ("solid", [8, 3], [2, 2], [8, 3, 2, 3], [3, 2, 3, 2, 3, 2])  # one for each colour, as in print


def shared_range(band: tuple[float, float], name: str = "frequency") -> Any:
    """Make the range of an axis; a page keeps all ranges of the same name equal."""
    from bokeh.models import Range1d  # lazy here and below: bokeh loads slowly

    return Range1d(band[0], band[1], name=name)


def framed(x_label: str, y_label: str, x_range: Any, height: int, **options: Any) -> Any:
    """Make an empty figure without a toolbar: a drag zooms into a box, the wheel scrolls the page.

    The page has buttons for the other functions of a toolbar, for keyboards and screen readers. Labels contain units;
    an empty label takes no space. ``height`` is in pixels; ``options`` are further settings of bokeh's figures.
    """
    from bokeh.plotting import figure

    settings = {"tools": "box_zoom", "toolbar_location": None, **options}
    plot = figure(x_range=x_range, height=height, sizing_mode="stretch_width", min_width=200, **settings)
    plot.toolbar.logo = None
    plot.xaxis.axis_label, plot.yaxis.axis_label = x_label or None, y_label or None
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = plot.axis.major_label_text_font_size = "12px"
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = "#111111"
    plot.outline_line_color = "#111111"
    plot.min_border_left = 72
    return plot


def hover(plot: Any, renderers: list[Any], tooltips: list[tuple[str, str]], mode: str = "mouse") -> None:
    """Show the values at the pointer."""
    from bokeh.models import HoverTool

    plot.add_tools(HoverTool(renderers=renderers, tooltips=tooltips, mode=mode))


def legend_above(plot: Any) -> None:
    """Place the legend above the figure, where it hides nothing; a click on a name hides its line."""
    legend = plot.legend[0]
    plot.add_layout(legend, "above")
    legend.orientation, legend.click_policy = "horizontal", "hide"
    legend.ncols = 2
    legend.border_line_color, legend.label_text_font_size, legend.padding = None, "12px", 2


def look(number: int) -> dict[str, Any]:
    """Return colour and dashes of the n-th line."""
    return {"line_color": COLOURS[number % len(COLOURS)], "line_dash": DASHES[number % len(DASHES)]}


Columns = Mapping[str, NDArray[np.floating[Any]]]

_NAME = re.compile(r"^p\d+$")


@dataclass(frozen=True)
class ZoomedPlot:
    """A figure that a browser draws."""

    document: str  # JSON of bokeh: the figure with its data
    choices: str = "[]"  # JSON list of objects with a label and sources (columns by name) from which a reader chooses


def as_plot(layout: Any, choices: Sequence[tuple[str, Mapping[str, Columns]]] = ()) -> ZoomedPlot:
    """Convert a layout or figure of bokeh to text; ``choices`` are labels, each with the columns of each source."""
    from bokeh.embed import json_item

    packed = [
        {"label": label, "sources": {name: _packed(columns) for name, columns in sources.items()}}
        for label, sources in choices
    ]
    return ZoomedPlot(json.dumps(_renumbered(json_item(layout))), json.dumps(packed))


def _packed(columns: Columns) -> dict[str, str]:
    """Encode columns as base64 of single-precision numbers, which are exact enough for a screen."""
    return {name: base64.b64encode(np.asarray(c, "<f4").tobytes()).decode("ascii") for name, c in columns.items()}


def _renumbered(item: Any) -> Any:
    """Renumber the names of bokeh's models from 1, so that equal figures give equal text."""
    names: dict[str, str] = {}

    def walk(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: walk(item) for key, item in value.items()}
        if isinstance(value, list):
            return [walk(item) for item in value]
        if isinstance(value, str) and _NAME.match(value):
            return names.setdefault(value, f"m{len(names) + 1}")
        return value

    return walk(item)


def browser_library() -> str:
    """Return the program that draws in the browser, as text.

    Raises
    ------
    InputError
        A version of bokeh whose text would end the script of a page.
    """
    from bokeh.util.paths import bokehjs_path

    text = (Path(bokehjs_path()) / "js" / "bokeh.min.js").read_text(encoding="utf-8")
    if "</script" in text.lower():
        raise InputError("this version of bokeh cannot be embedded in a page; install another one")
    return text


# stability of a pole against the model of the next lower order
KINDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("new pole", {"marker": "dot", "color": "#8a8a8a", "size": 9}),
    ("stable frequency", {"marker": "cross", "color": COLOURS[1], "size": 8}),
    ("and damping", {"marker": "x", "color": COLOURS[3], "size": 8}),
    ("and vector", {"marker": "circle", "color": COLOURS[0], "size": 7, "fill_alpha": 0.0}),
)


def zoomed_chart(chart: StabilisationChart, frf: Frf | None = None, model: ModalModel | None = None) -> ZoomedPlot:
    """Draw poles over order, and over damping, with the sum of all FRFs behind and the fitted modes marked.

    Parameters
    ----------
    chart
        Stabilisation chart of a fit.
    frf
        FRF whose summed magnitude is drawn behind the chart, on a scale of its own.
    model
        Modal model whose modes are marked.
    """
    from bokeh.layouts import column

    orders, damping = _panels(chart, frf, _dampings(model))
    if model is not None:
        _mark(orders, damping, model)
    legend_above(orders)
    return as_plot(column(orders, damping, sizing_mode="stretch_width"))


def picking_chart(chart: StabilisationChart, frf: Frf | None = None) -> Any:
    """Draw the chart on which poles are picked, as a column of bokeh's figures.

    The page fills the source ``chosen`` with the choice.

    The panels have the names ``orders`` and ``damping``; the range of orders has the name ``top``.

    Parameters
    ----------
    chart
        Stabilisation chart of a fit.
    frf
        FRF whose summed magnitude is drawn behind the chart.
    """
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, Range1d

    orders, damping = _panels(chart, frf, [0.1])
    orders.name, damping.name = "orders", "damping"
    orders.y_range = Range1d(0.0, 1.05 * float(chart.orders.max(initial=1)), name="top")
    chosen = ColumnDataSource({"f": [], "zeta": [], "low": [], "high": []}, name="chosen")
    look: dict[str, Any] = {"line_color": FITTED, "line_width": 2, "line_dash": [6, 3], "legend_label": "chosen"}
    orders.segment(x0="f", y0="low", x1="f", y1="high", source=chosen, **look)
    marks: dict[str, Any] = {"marker": "diamond", "size": 14, "color": FITTED, "fill_alpha": 0.0, "line_width": 2}
    damping.scatter("f", "zeta", source=chosen, **marks)
    legend_above(orders)
    return column(orders, damping, sizing_mode="stretch_width")


def _panels(chart: StabilisationChart, frf: Frf | None, dampings: list[float]) -> tuple[Any, Any]:
    """Draw all poles over order and stable poles over damping, without marks of chosen poles."""
    from bokeh.models import ColumnDataSource

    band = shared_range(chart.band)
    orders = framed("", "Model order (1)", band, 330)
    damping = framed("Frequency (Hz)", "Damping ratio (%)", band, 190)
    if frf is not None:
        f, level = _sum(frf, chart.band)
        orders.line(f, level * float(chart.orders.max(initial=1)), line_color="#b0b0b0", legend_label="Σ|H|, log scale")
    tips = [("frequency", "@f{0.000} Hz"), ("damping", "@zeta{0.000} %"), ("order", "@order")]
    for kind, (label, marks) in enumerate(KINDS):
        chosen = chart.stability == kind
        zeta = 100 * chart.damping_ratios[chosen]
        source = ColumnDataSource({"f": chart.frequencies[chosen], "zeta": zeta, "order": chart.orders[chosen]})
        dots = orders.scatter("f", "order", source=source, legend_label=label, **marks)
        hover(orders, [dots], tips)
        if kind >= 2:
            hover(damping, [damping.scatter("f", "zeta", source=source, **marks)], tips)
    stable = 100 * chart.damping_ratios[chart.stability >= 2]
    top = float(np.percentile(stable, 95)) if len(stable) else 5.0
    damping.y_range.start, damping.y_range.end = 0.0, 1.3 * max(top, *dampings)
    return orders, damping


def _dampings(model: ModalModel | None) -> list[float]:
    return [0.1] if model is None else [0.1, *(100 * model.damping_ratios)]


def _sum(frf: Frf, band: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies (Hz), and the logarithm of the summed magnitude scaled to the range 0 to 1."""
    in_band = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1]) & frf.valid
    level = np.log10(np.maximum(np.abs(frf.values[in_band]).sum(axis=(1, 2)), 1e-300))
    if not len(level):
        return frf.frequencies[in_band], level
    return frf.frequencies[in_band], (level - level.min()) / max(float(np.ptp(level)), 1e-12)


def _mark(orders: Any, damping: Any, model: ModalModel) -> None:
    from bokeh.models import Span

    for frequency in model.natural_frequencies:
        look = {"line_color": FITTED, "line_dash": [6, 3], "line_width": 1.5}
        orders.add_layout(Span(location=float(frequency), dimension="height", **look))
    zeta = 100 * model.damping_ratios
    marks: dict[str, Any] = {"marker": "diamond", "size": 13, "color": FITTED, "fill_alpha": 0.0, "line_width": 2}
    dots = damping.scatter(model.natural_frequencies, zeta, **marks)
    hover(damping, [dots], [("mode of the model", ""), ("frequency", "@x{0.000} Hz"), ("damping", "@y{0.000} %")])


_ORDINALS = ("first curve", "second curve", "third curve")


def zoomed_indicators(
    complex_indicator: ComplexModeIndicator, multivariate: MultivariateModeIndicator, model: ModalModel | None = None
) -> ZoomedPlot:
    """Draw singular values above, eigenvalues of the multivariate indicator below.

    Parameters
    ----------
    complex_indicator, multivariate
        Complex and multivariate mode indicators of one FRF in one band.
    model
        Modal model whose natural frequencies are marked.
    """
    from bokeh.layouts import column
    from bokeh.models import Span

    f = complex_indicator.frequencies
    band = shared_range((float(f[0]), float(f[-1])))
    sizes = framed("", f"CMIF ({complex_indicator.unit})", band, 280, y_axis_type="log")
    shares = framed("Frequency (Hz)", "MIF (1)", band, 190, y_range=(0.0, 1.02))
    for curve in range(min(len(_ORDINALS), complex_indicator.singular_values.shape[1])):
        values = complex_indicator.singular_values[:, curve]
        drawn = sizes.line(f, values, legend_label=_ORDINALS[curve], **look(curve))
        _hover_frequency(sizes, drawn, _ORDINALS[curve], "@y{0.000e}")
    for curve in range(min(len(_ORDINALS), multivariate.values.shape[1])):
        drawn = shares.line(multivariate.frequencies, multivariate.values[:, curve], **look(curve))
        _hover_frequency(shares, drawn, _ORDINALS[curve], "@y{0.000}")
    for frequency in () if model is None else model.natural_frequencies:
        for plot in (sizes, shares):
            plot.add_layout(Span(location=float(frequency), dimension="height", line_color=FITTED, line_dash=[6, 3]))
    legend_above(sizes)
    return as_plot(column(sizes, shares, sizing_mode="stretch_width"))


def _hover_frequency(plot: Any, drawn: Any, name: str, value: str) -> None:
    hover(plot, [drawn], [(name, value), ("frequency", "@x{0.000} Hz")])


def zoomed_sums(compared: Synthesis, unit: str) -> ZoomedPlot:
    """Draw the sums of measured and synthesised magnitudes over the entries that the model contains.

    Parameters
    ----------
    compared
        FRFs of the measurement and of the model.
    unit
        Unit of both FRFs.
    """
    known, f = np.isfinite(compared.misfit), compared.frequencies
    measured, modelled = compared.measured[:, known], compared.synthesised[:, known]
    plot = framed("Frequency (Hz)", f"Σ|H| ({unit})", shared_range((float(f[0]), float(f[-1]))), 340, y_axis_type="log")
    curves = {"measured": measured, "synthesised": modelled, "difference": measured - modelled}
    for number, (name, values) in enumerate(curves.items()):
        drawn = plot.line(f, np.abs(values).sum(axis=1), legend_label=name, **look(number))
        hover(plot, [drawn], [(name, "@y{0.000e}"), ("frequency", "@x{0.000} Hz")])
    legend_above(plot)
    return as_plot(plot)
