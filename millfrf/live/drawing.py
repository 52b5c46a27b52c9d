"""`Drawing`: a figure of the page that is made once and then fed with snapshots."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .monitor import Snapshot

GREEN, RED, GREY = "#009E73", "#D55E00", "#999999"
_MOST_LINES = 4000


@dataclass(frozen=True)
class Drawing:
    """A figure and how it takes a snapshot.

    Parameters
    ----------
    figure
        Figure of the page, for the layout.
    update
        Called in the page's own thread.
    """

    figure: Any
    update: Callable[[Snapshot], None]


def framed(title: str, x_label: str, y_label: str, **options: Any) -> Any:
    """An empty figure with its labels, without tools."""
    from bokeh.plotting import figure

    plot = figure(title=title, x_axis_label=x_label, y_axis_label=y_label, **{"height": 300, "tools": "", **options})
    plot.toolbar.logo = None
    plot.toolbar_location = None
    plot.axis.axis_label_text_font_style = "normal"
    return plot


def thinned(n: int) -> slice:
    """Every how-manyeth of ``n`` lines is drawn."""
    return slice(None, None, max(1, n // _MOST_LINES))


def number(value: float) -> str:
    """Three digits, as people write them.

    Examples
    --------
    >>> number(1234.5), number(0.000123), number(0.0)
    ('1230', '0.000123', '0')
    """
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if 100 <= abs(rounded) < 1e5 else f"{rounded:g}"
