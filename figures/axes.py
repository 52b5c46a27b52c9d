"""Axes that a user gives, or new ones in the house's style, for the `plot()` of a result."""

from collections.abc import Iterator
from contextlib import contextmanager

from matplotlib.axes import Axes

from .style import WIDTH_MM, house_style

HEIGHT_MM = 80.0
"""Of new axes."""


@contextmanager
def given_or_new(axes: Axes | None, height_mm: float = HEIGHT_MM) -> Iterator[Axes]:
    """Axes to draw into: the given ones in their own style, or new ones of pyplot, which a notebook shows.

    Parameters
    ----------
    axes
        Of a user, or None.
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
