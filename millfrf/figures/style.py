"""Style of all figures: sizes for print, colours for colour-blind readers, logarithmic axes."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import TICKRIGHT, TICKUP
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator
from numpy.typing import NDArray

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


HEIGHT_MM = 80.0
"""Of new axes."""


@contextmanager
def given_or_new(axes: Axes | None, height_mm: float = HEIGHT_MM) -> Iterator[Axes]:
    """Axes to draw into: the given ones in their own style, or new ones of pyplot, which a notebook shows.

    Parameters
    ----------
    axes
        Axes that a user gives, or None for new ones.
    height_mm
        Height of a new figure, mm.
    """
    if axes is not None:
        yield axes
        return
    import matplotlib.pyplot as plt  # not above: reports draw without pyplot, which looks for a screen

    with house_style():
        _, made = plt.subplots(figsize=(WIDTH_MM / 25.4, height_mm / 25.4), layout="constrained")
        yield made


def legend_beside(axes: Axes, title: str | None = None) -> None:
    """A legend to the right of the axes, where it hides no data; none for a single line without a title."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > 1 or (labels and title):
        size = axes.xaxis.label.get_fontsize()  # that of the axes, whose style may no longer be set
        beside = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "frameon": False, "handlelength": 2.6}
        axes.legend(handles, labels, title=title, fontsize=size, title_fontsize=size, **beside)


MOST_DECADES = 6
"""Labelled decades; more are labelled in equal steps."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain_log_axis(axes: Axes, side: str, low: float, high: float) -> None:
    """Scale one axis logarithmically from ``low`` to ``high``, with plain numbers at 1, 2 and 5 times the decades.

    Parameters
    ----------
    axes
        Axes whose x or y axis is set.
    side
        ``x`` or ``y``.
    low, high
        Ends of the axis, positive.
    """
    axis = _scaled(axes, side, low, high)
    ticks = np.outer(10.0 ** _decades(low, high), (1, 2, 5)).ravel()
    inside = ticks[(ticks >= low) & (ticks <= high)]
    _label(axis, inside, [f"{tick:g}" for tick in inside])


def decade_axis(axes: Axes, side: str, low: float, high: float, label: Callable[[int], str] | None = None) -> None:
    """Scale one axis logarithmically from ``low`` to ``high``, with a number at each decade and small marks between.

    Between less than two decades, plain numbers stand at 1, 2 and 5 times the decades.

    Parameters
    ----------
    axes
        Axes whose x or y axis is set.
    side
        ``x`` or ``y``.
    low, high
        Ends of the axis, positive.
    label
        Gives the words at a power of ten; None: :func:`power_of_ten`.
    """
    powers = _decades(low, high)
    shown = powers[(10.0**powers >= low) & (10.0**powers <= high)]
    if len(shown) < 2:
        plain_log_axis(axes, side, low, high)
        return
    axis = _scaled(axes, side, low, high)
    step = -(-len(shown) // MOST_DECADES)
    labelled = shown[shown % step == 0] if step > 1 else shown
    _label(axis, 10.0**labelled, [(label or power_of_ten)(int(power)) for power in labelled])
    between = 10.0**shown if step > 1 else np.outer(10.0**powers, np.arange(2, 10)).ravel()
    _mark(axes, side, between[(between > low) & (between < high)])


def power_of_ten(power: int) -> str:
    """Ten to a power, with raised digits.

    Examples
    --------
    >>> power_of_ten(-12)
    '10⁻¹²'
    """
    return "10" + str(power).translate(_RAISED)


def _decades(low: float, high: float) -> NDArray[np.float64]:
    """Powers of the decades that hold the range."""
    return np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)


def _scaled(axes: Axes, side: str, low: float, high: float) -> Axis:
    axes.set(**{f"{side}scale": "log", f"{side}lim": (low, high)})
    axis: Axis = getattr(axes, f"{side}axis")
    axis.set_minor_locator(NullLocator())
    return axis


def _label(axis: Axis, ticks: NDArray[np.float64], labels: list[str]) -> None:
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_major_formatter(FixedFormatter(labels))


def _mark(axes: Axes, side: str, places: NDArray[np.float64]) -> None:
    """Small marks along the left or lower edge."""
    edge = np.zeros(len(places))
    look: dict[str, Any] = {"linestyle": "none", "color": "black", "markersize": 2.0, "markeredgewidth": 0.5}
    if side == "x":
        marks = Line2D(places, edge, marker=TICKUP, transform=axes.get_xaxis_transform(), **look)
    else:
        marks = Line2D(edge, places, marker=TICKRIGHT, transform=axes.get_yaxis_transform(), **look)
    axes.add_artist(marks)
