"""How every figure looks: sizes for print at 180 mm, colours that survive colour blindness and grey printing."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

WIDTH_MM = 180.0
"""Printed width of a figure: the text width of an A4 page."""

COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
"""Okabe & Ito, Color Universal Design, in an order of falling contrast to white."""

LINE_STYLES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1.2)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (8, 3)),
)
"""One for each colour, so that lines can be told apart in grey."""

MEASURED, FITTED, TRUE = COLOURS[0], COLOURS[2], COLOURS[1]
SHADE = "#d9d9d9"

_SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "axes.titley": 1.0,  # no search for ticks above the axes, of which there are none: a fifth of the drawing time
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.linewidth": 0.4,
    "grid.color": "#e3e3e3",
    "lines.linewidth": 1.1,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "legend.borderpad": 0.3,
    "legend.handlelength": 2.6,
    "svg.fonttype": "path",
    "svg.hashsalt": "millfrf",
    "figure.dpi": 100,
    "savefig.dpi": 200,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Matplotlib settings of this project inside the block; the user's own come back after it."""
    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(height_mm: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure of a printed size, apart from pyplot's global state.

    Constrained layout measures every label; a page of many panels with no layout engine places them itself, ten times
    faster.
    """
    figure = Figure(figsize=(WIDTH_MM / 25.4, height_mm / 25.4), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def place_panels(figure: Figure, left: float, top: float, right: float = 3.5, bottom: float = 11.0) -> None:
    """Margins around the panels of a figure without a layout engine, mm."""
    width, height = 25.4 * figure.get_size_inches()
    figure.subplots_adjust(left / width, bottom / height, 1 - right / width, 1 - top / height)


def legend_height(axes: Axes, columns: int = 4) -> float:
    """Room that :func:`legend_above` takes at the top of a figure, mm."""
    rows = -(-len(axes.get_legend_handles_labels()[1]) // columns)
    return 3.0 + 4.4 * rows


def line_style(number: int) -> dict[str, Any]:
    """Colour and dashes of the n-th line of a panel; from the seventh on also marks, for colours come round again."""
    look = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINE_STYLES[number % len(LINE_STYLES)]}
    return look if number < len(COLOURS) else look | {"marker": "o", "markevery": 0.08, "markersize": 3.0}


def panel_letter(axes: Axes, number: int) -> None:
    """``(a)``, ``(b)`` ... above the left corner, for the caption to refer to."""
    axes.text(0.0, 1.02, f"({chr(ord('a') + number)})", transform=axes.transAxes, ha="left", va="bottom")


def legend_above(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """One legend for all panels, above them, where it hides no data."""
    handles, labels = axes.get_legend_handles_labels()
    if labels:
        figure.legend(handles, labels, loc="outside upper center", ncols=min(columns, len(labels)))
