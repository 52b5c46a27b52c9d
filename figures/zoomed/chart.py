"""A stabilisation chart that zooms: each pole tells its frequency, damping and order."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from modal_fit import ModalModel, StabilisationChart

from ..style import COLOURS, FITTED
from .framed import framed, hover, legend_above, shared_range
from .plot import ZoomedPlot, as_plot

KINDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("new pole", {"marker": "dot", "color": "#8a8a8a", "size": 9}),
    ("stable frequency", {"marker": "cross", "color": COLOURS[1], "size": 8}),
    ("and damping", {"marker": "x", "color": COLOURS[3], "size": 8}),
    ("and vector", {"marker": "circle", "color": COLOURS[0], "size": 7, "fill_alpha": 0.0}),
)
"""Stability of a pole against the model of the order before."""


def zoomed_chart(chart: StabilisationChart, frf: Frf | None = None, model: ModalModel | None = None) -> ZoomedPlot:
    """Poles over order, and over damping, with the sum of all FRFs behind and the fitted modes marked.

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


def picking_chart(chart: StabilisationChart, frf: Frf | None = None) -> ZoomedPlot:
    """The chart on which poles are picked: the choice is a source ``chosen``, which the page fills.

    Its panels are named ``orders`` and ``damping``, the range of orders ``top``.

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
    return as_plot(column(orders, damping, sizing_mode="stretch_width"))


def _panels(chart: StabilisationChart, frf: Frf | None, dampings: list[float]) -> tuple[Any, Any]:
    """Poles over order, and those that are stable over damping, without marks of a choice."""
    from bokeh.models import ColumnDataSource

    band = shared_range(chart.band)
    orders = framed("", "Model order (1)", band, 330)
    damping = framed("Frequency (Hz)", "Damping ratio (%)", band, 190)
    if frf is not None:
        f, level = _sum(frf, chart.band)
        orders.line(f, level * float(chart.orders.max(initial=1)), line_color="#b0b0b0", legend_label="Σ|H|, log scale")
    told = [("frequency", "@f{0.000} Hz"), ("damping", "@zeta{0.000} %"), ("order", "@order")]
    for kind, (label, marks) in enumerate(KINDS):
        chosen = chart.stability == kind
        zeta = 100 * chart.damping_ratios[chosen]
        source = ColumnDataSource({"f": chart.frequencies[chosen], "zeta": zeta, "order": chart.orders[chosen]})
        drawn = [orders.scatter("f", "order", source=source, legend_label=label, **marks)]
        hover(orders, drawn, told)
        if kind >= 2:
            hover(damping, [damping.scatter("f", "zeta", source=source, **marks)], told)
    stable = 100 * chart.damping_ratios[chart.stability >= 2]
    top = float(np.percentile(stable, 95)) if len(stable) else 5.0
    damping.y_range.start, damping.y_range.end = 0.0, 1.3 * max(top, *dampings)
    return orders, damping


def _dampings(model: ModalModel | None) -> list[float]:
    return [0.1] if model is None else [0.1, *(100 * model.damping_ratios)]


def _sum(frf: Frf, band: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies, and the logarithm of the summed magnitude between 0 and 1."""
    inside = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1]) & frf.valid
    level = np.log10(np.maximum(np.abs(frf.values[inside]).sum(axis=(1, 2)), 1e-300))
    if not len(level):
        return frf.frequencies[inside], level
    return frf.frequencies[inside], (level - level.min()) / max(float(np.ptp(level)), 1e-12)


def _mark(orders: Any, damping: Any, model: ModalModel) -> None:
    from bokeh.models import Span

    for frequency in model.natural_frequencies:
        look = {"line_color": FITTED, "line_dash": [6, 3], "line_width": 1.5}
        orders.add_layout(Span(location=float(frequency), dimension="height", **look))
    zeta = 100 * model.damping_ratios
    marks: dict[str, Any] = {"marker": "diamond", "size": 13, "color": FITTED, "fill_alpha": 0.0, "line_width": 2}
    drawn = damping.scatter(model.natural_frequencies, zeta, **marks)
    hover(damping, [drawn], [("mode of the model", ""), ("frequency", "@x{0.000} Hz"), ("damping", "@y{0.000} %")])
