"""Maps over poses: one panel a quantity, shades that survive grey printing, values beside the marks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from millfrf.figures import house_style, new_figure

from .places import MapPlane
from .written_values import free_sides

SHADES = "cividis"
"""Rises in lightness from end to end, and looks the same to the colour blind."""

COLUMNS, ROW_MM = 3, 62.0

MOST_WRITTEN = 24
"""Poses up to which each value is written beside its mark."""


@dataclass(frozen=True)
class MapPanel:
    """One quantity over poses.

    Parameters
    ----------
    title
        Name of the quantity with its unit.
    values
        Value by the name of the pose; a pose without one is an empty ring.
    """

    title: str
    values: Mapping[str, float]


def draw_maps(panels: Sequence[MapPanel], plane: MapPlane) -> Figure:
    """Draw panels in rows of three; fewer panels make a narrower picture.

    Parameters
    ----------
    panels
        Quantities to draw.
    plane
        Where the poses lie.
    """
    columns = min(COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    with house_style():
        figure = new_figure(rows * ROW_MM + 4.0)
        figure.set_figwidth(figure.get_figwidth() * columns / COLUMNS)
        axes = figure.subplots(rows, columns, squeeze=False)
        for k, place in enumerate(axes.ravel()):
            if k >= len(panels):
                place.set_visible(False)
                continue
            _panel(figure, place, panels[k], plane)
            place.set_xlabel(plane.labels[0])
            if k % columns == 0 and not plane.names:
                place.set_ylabel(plane.labels[1])
    return figure


def _panel(figure: Figure, axes: Axes, panel: MapPanel, plane: MapPlane) -> None:
    known = [pose for pose in plane.places if np.isfinite(panel.values.get(pose, np.nan))]
    missing = [pose for pose in plane.places if pose not in known]
    axes.set_title(panel.title)
    if plane.names:
        _named(axes, panel, plane, known)
        return
    at = np.array([plane.places[pose] for pose in known]).reshape(-1, 2)
    values = [panel.values[pose] for pose in known]
    if missing:
        empty = np.array([plane.places[pose] for pose in missing])
        axes.plot(empty[:, 0], empty[:, 1], "o", markerfacecolor="none", markeredgecolor="0.5", markersize=6)
    if known:
        marks = axes.scatter(at[:, 0], at[:, 1], c=values, cmap=SHADES, s=42, edgecolors="black", linewidths=0.5)
        bar = figure.colorbar(marks, ax=axes, location="bottom", ticks=MaxNLocator(5), shrink=0.9, aspect=28, pad=0.02)
        bar.ax.tick_params(labelsize=7)
    if known and len(known) <= MOST_WRITTEN:
        texts = [f"{value:.{_digits(values)}f}" for value in values]
        for place, text, side in zip(at, texts, free_sides(at, texts), strict=True):
            if side is not None:
                x, y = place
                axes.annotate(text, (x, y), side, textcoords="offset points", ha="center", va="center", fontsize=6)
    axes.margins(0.14)
    axes.locator_params(nbins=5)


def _named(axes: Axes, panel: MapPanel, plane: MapPlane, known: Sequence[str]) -> None:
    """Poses without places: a value above each name."""
    names = list(plane.places)
    axes.plot([names.index(pose) for pose in known], [panel.values[pose] for pose in known], "o", color="black")
    shown = list(range(0, len(names), max(1, -(-len(names) // 8))))
    axes.set_xticks(shown, [names[k] for k in shown], rotation=60 if len(names) > 3 else 0)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.ticklabel_format(axis="y", useOffset=False)


def _digits(values: Sequence[float]) -> int:
    """Decimals that tell the values apart, three digits of the largest at least."""
    largest = max((abs(value) for value in values), default=1.0)
    return int(np.clip(2 - np.floor(np.log10(largest)) if largest > 0 else 2, 0, 4))
