"""Pictures of drifts: the pose that drifts with its line and band, the other poses in grey behind it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import t as student

from millfrf.figures import COLOURS, SHADE, house_style, new_figure, panel_letter

from ..drift import Drift, Series, Trend

COLUMNS, ROW_MM = 2, 58.0

MOST_PANELS = 8
"""Drifts that are drawn, the most certain ones."""


def draw_trends(drifts: Sequence[Drift], every: Sequence[Trend], words: Sequence[tuple[str, str]]) -> Figure:
    """Draw the first drifts, two in a row.

    Parameters
    ----------
    drifts
        Drifts to draw.
    every
        All trends that were looked at, for the other poses.
    words
        Title and label of the x axis of each drift.
    """
    shown = list(drifts[:MOST_PANELS])
    columns = min(COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    with house_style():
        figure = new_figure(rows * ROW_MM + 4.0)
        figure.set_figwidth(figure.get_figwidth() * columns / COLUMNS)
        axes = figure.subplots(rows, columns, squeeze=False)
        for k, place in enumerate(axes.ravel()):
            if k >= len(shown):
                place.set_visible(False)
                continue
            _panel(place, shown[k].trend, every)
            if len(shown) > 1:
                panel_letter(place, k)
            place.set_title(words[k][0])
            place.set_xlabel(words[k][1])
            place.set_ylabel("change from the pose's mean (%)")
    return figure


def _panel(axes: Axes, trend: Trend, every: Sequence[Trend]) -> None:
    own = trend.series
    for one in every:
        same = (one.series.mode, one.series.quantity, one.label) == (own.mode, own.quantity, trend.label)
        if same and one.series.pose != own.pose:
            x, y, _ = _points(one)
            axes.plot(x, y, "-", color=SHADE, linewidth=0.8, zorder=1)
    x, y, spread = _points(trend)
    line = np.linspace(x.min(), x.max(), 50)
    middle = 100 * np.expm1(trend.slope * (line - trend.values.mean()))
    band = 100 * student.ppf(0.975, trend.freedom) * trend.error * np.abs(line - trend.values.mean())
    axes.fill_between(line, middle - band, middle + band, color=COLOURS[2], alpha=0.25, linewidth=0, zorder=2)
    axes.plot(line, middle, color=COLOURS[2], zorder=3)
    axes.errorbar(x, y, 2 * spread, fmt="o", color="black", markersize=3.5, elinewidth=0.8, capsize=2, zorder=4)
    axes.margins(x=0.08)
    if np.all(trend.values == np.round(trend.values)):
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))


def _points(trend: Trend) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Label, deviation from the mean and stated standard error of the sets, the last two in per cent."""
    series: Series = trend.series
    chosen = np.array([row in trend.rows for row in series.rows])
    logs = series.logs[chosen]
    order = np.argsort(trend.values, kind="stable")
    return trend.values[order], 100 * np.expm1(logs - logs.mean())[order], 100 * series.errors[chosen][order]
