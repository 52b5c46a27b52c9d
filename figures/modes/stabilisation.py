"""Stabilisation chart: poles over model order above the summed FRF, and their damping."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation import Frf
from modal_fit import ModalModel, StabilisationChart

from ..style import FITTED, house_style, legend_above, new_figure, panel_letter

_KINDS = (
    ("new pole", {"marker": ".", "color": "#a6a6a6", "markersize": 3}),
    ("stable frequency", {"marker": "+", "color": "#0072B2", "markersize": 4.5}),
    ("stable frequency and damping", {"marker": "x", "color": "#009E73", "markersize": 4.5}),
    (
        "stable frequency, damping and vector",
        {"marker": "o", "color": "#000000", "markersize": 3.6, "markerfacecolor": "none"},
    ),
)


def stabilisation_figure(chart: StabilisationChart, frf: Frf | None = None, model: ModalModel | None = None) -> Figure:
    """Draw a stabilisation chart: poles over order and over damping.

    Parameters
    ----------
    chart
        Stabilisation chart of a fit.
    frf
        FRF whose summed magnitude is drawn behind the chart.
    model
        Modal model whose natural frequencies and damping ratios are marked.
    """
    with house_style():
        figure = new_figure(125.0)
        orders, damping = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
        if frf is not None:
            _draw_sum(orders, frf, chart.band)
        for kind, (label, style) in enumerate(_KINDS):
            chosen = chart.stability == kind
            marks = {"linestyle": "none", "markeredgewidth": 0.8, **style}
            orders.plot(chart.frequencies[chosen], chart.orders[chosen], label=label, **marks)
            if kind >= 2:
                damping.plot(chart.frequencies[chosen], 100 * chart.damping_ratios[chosen], **marks)
        if model is not None:
            _mark_modes(orders, damping, model)
        orders.set_ylabel("Model order (1)")
        orders.set_xlim(*chart.band)
        damping.set_ylabel("Damping ratio (%)")
        damping.set_xlabel("Frequency (Hz)")
        damping.set_ylim(0, _damping_limit(chart, model))
        panel_letter(orders, 0)
        panel_letter(damping, 1)
        legend_above(figure, orders, columns=3)
    return figure


def _draw_sum(orders: Axes, frf: Frf, band: tuple[float, float]) -> None:
    behind = orders.twinx()
    inside = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1]) & frf.valid
    total = np.sum(np.abs(frf.values[inside]), axis=(1, 2))
    behind.semilogy(frf.frequencies[inside], total, color="#b0b0b0", linewidth=1.6)
    behind.set_ylabel(f"Σ|H| ({frf.unit})", color="#666666")
    behind.grid(visible=False)
    orders.set_zorder(behind.get_zorder() + 1)
    orders.patch.set_visible(False)


def _mark_modes(orders: Axes, damping: Axes, model: ModalModel) -> None:
    for number, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        label = "mode of the fitted model" if number == 0 else None
        orders.axvline(frequency, color=FITTED, linewidth=1.0, linestyle=(0, (5, 1.5)), label=label)
        damping.plot(frequency, 100 * zeta, marker="D", markersize=7, color=FITTED, markerfacecolor="none")


def _damping_limit(chart: StabilisationChart, model: ModalModel | None) -> float:
    """Room for every mode and for nearly all stable poles."""
    zeta = 100 * chart.damping_ratios[chart.stability >= 2]
    top = float(np.percentile(zeta, 90)) if len(zeta) else 1.0
    if model is not None and len(model.poles):
        top = max(top, 100 * float(model.damping_ratios.max()))
    return 1.3 * top
