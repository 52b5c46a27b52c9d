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

WIDTH_MM = 180.0  # printed width of a figure: the text width of an A4 page

# Okabe & Ito, Color Universal Design, in an order of falling contrast to white
COLOURS = ("#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")

# one for each colour, so that lines differ in a grey print too
LINE_STYLES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1, 1.2)),
    (0, (5, 1.5, 1, 1.5)),
    (0, (3, 1, 1, 1, 1, 1)),
    (0, (8, 3)),
)

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
    """Use the matplotlib settings of this project in the block, and restore the user's settings after it."""
    with mpl.rc_context(_SETTINGS):
        yield


def new_figure(height_mm: float, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """Make an empty figure of a printed size, independent of pyplot's global state.

    Constrained layout measures every label. A figure of many panels without a layout engine, whose code sets the
    positions of the panels, is drawn ten times faster.
    """
    figure = Figure(figsize=(WIDTH_MM / 25.4, height_mm / 25.4), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def place_panels(figure: Figure, left: float, top: float, right: float = 3.5, bottom: float = 11.0) -> None:
    """Set the margins (mm) around the panels of a figure without a layout engine."""
    width, height = 25.4 * figure.get_size_inches()
    figure.subplots_adjust(left / width, bottom / height, 1 - right / width, 1 - top / height)


def legend_height(axes: Axes, columns: int = 4) -> float:
    """Return the height (mm) that :func:`legend_above` needs at the top of a figure."""
    rows = -(-len(axes.get_legend_handles_labels()[1]) // columns)
    return 3.0 + 4.4 * rows


def line_style(number: int) -> dict[str, Any]:
    """Return colour and dashes of the n-th line of a panel; add markers from the seventh line on."""
    style = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINE_STYLES[number % len(LINE_STYLES)]}
    return style if number < len(COLOURS) else style | {"marker": "o", "markevery": 0.08, "markersize": 3.0}


def panel_letter(axes: Axes, number: int) -> None:
    """Write ``(a)``, ``(b)`` ... above the left corner, for reference in the caption."""
    axes.text(0.0, 1.02, f"({chr(ord('a') + number)})", transform=axes.transAxes, ha="left", va="bottom")


def legend_above(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """Draw one legend for all panels above the panels, where it hides no data."""
    handles, labels = axes.get_legend_handles_labels()
    if labels:
        figure.legend(handles, labels, loc="outside upper center", ncols=min(columns, len(labels)))


@contextmanager
def given_or_new(axes: Axes | None, height_mm: float = 80.0) -> Iterator[Axes]:
    """Yield the given axes without a change of style; without given axes, yield new axes that a notebook shows."""
    if axes is not None:
        yield axes
        return
    import matplotlib.pyplot as plt  # lazy: reports draw without pyplot, which looks for a screen

    with house_style():
        _, new_axes = plt.subplots(figsize=(WIDTH_MM / 25.4, height_mm / 25.4), layout="constrained")
        yield new_axes


def legend_beside(axes: Axes, title: str | None = None) -> None:
    """Draw a legend to the right of the axes, where it hides no data; draw none for a single line without a title."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > 1 or (labels and title):
        size = axes.xaxis.label.get_fontsize()  # of the axes, whose style may no longer be active
        position = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "frameon": False, "handlelength": 2.6}
        axes.legend(handles, labels, title=title, fontsize=size, title_fontsize=size, **position)


MAX_DECADES = 6  # labelled decades; of more, only some are labelled, in equal steps

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain_log_axis(axes: Axes, side: str, low: float, high: float) -> None:
    """Make the ``x`` or ``y`` axis logarithmic from ``low`` to ``high``, with numbers at 1, 2 and 5 times 10^n."""
    axis = _scaled(axes, side, low, high)
    ticks = np.outer(10.0 ** _decades(low, high), (1, 2, 5)).ravel()
    ticks = ticks[(ticks >= low) & (ticks <= high)]
    _label(axis, ticks, [f"{tick:g}" for tick in ticks])


def decade_axis(axes: Axes, side: str, low: float, high: float, label: Callable[[int], str] | None = None) -> None:
    """Make the ``x`` or ``y`` axis logarithmic, with a number at each decade and small ticks between.

    An axis of less than two decades has plain numbers at 1, 2 and 5 times the decades. ``label`` formats a power of
    ten; None: :func:`power_of_ten`.
    """
    powers = _decades(low, high)
    shown = powers[(10.0**powers >= low) & (10.0**powers <= high)]
    if len(shown) < 2:
        plain_log_axis(axes, side, low, high)
        return
    axis = _scaled(axes, side, low, high)
    step = -(-len(shown) // MAX_DECADES)
    labelled = shown[shown % step == 0] if step > 1 else shown
    _label(axis, 10.0**labelled, [(label or power_of_ten)(int(power)) for power in labelled])
    between = 10.0**shown if step > 1 else np.outer(10.0**powers, np.arange(2, 10)).ravel()
    _mark(axes, side, between[(between > low) & (between < high)])


def power_of_ten(power: int) -> str:
    """Format a power of ten with raised digits.

    Examples
    --------
    >>> power_of_ten(-12)
    '10⁻¹²'
    """
    return "10" + str(power).translate(_RAISED)


def _decades(low: float, high: float) -> NDArray[np.float64]:
    """Return the powers of the decades that cover a range."""
    return np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)


def _scaled(axes: Axes, side: str, low: float, high: float) -> Axis:
    axes.set(**{f"{side}scale": "log", f"{side}lim": (low, high)})
    axis: Axis = getattr(axes, f"{side}axis")
    axis.set_minor_locator(NullLocator())
    return axis


def _label(axis: Axis, ticks: NDArray[np.float64], labels: list[str]) -> None:
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_major_formatter(FixedFormatter(labels))


def _mark(axes: Axes, side: str, positions: NDArray[np.float64]) -> None:
    """Draw small ticks along the left or lower edge."""
    edge = np.zeros(len(positions))
    style: dict[str, Any] = {"linestyle": "none", "color": "black", "markersize": 2.0, "markeredgewidth": 0.5}
    if side == "x":
        marks = Line2D(positions, edge, marker=TICKUP, transform=axes.get_xaxis_transform(), **style)
    else:
        marks = Line2D(edge, positions, marker=TICKRIGHT, transform=axes.get_yaxis_transform(), **style)
    axes.add_artist(marks)
