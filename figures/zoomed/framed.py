"""An empty figure of bokeh in the house's style, and the tools of all its figures."""

from typing import Any

from ..style import COLOURS

DASHES = ("solid", [8, 3], [2, 2], [8, 3, 2, 3], [3, 2, 3, 2, 3, 2])
"""One for each colour, as in print."""

FREQUENCY = "frequency"
"""Name of the ranges that a page keeps equal in all its figures."""


def shared_range(band: tuple[float, float], name: str = FREQUENCY) -> Any:
    """Range of an axis that all figures of a page share by its name.

    Parameters
    ----------
    band
        Ends of the axis.
    name
        What the axis shows.
    """
    from bokeh.models import Range1d

    return Range1d(band[0], band[1], name=name)


def framed(x_label: str, y_label: str, x_range: Any, height: int, **options: Any) -> Any:
    """An empty figure without a toolbar: a drag zooms into a box, the wheel scrolls the page.

    The page has buttons for what else a toolbar does, which a keyboard reaches and a screen reader names.

    Parameters
    ----------
    x_label, y_label
        Labels with units; an empty one takes no room.
    x_range
        Range of the horizontal axis.
    height
        Height in pixels.
    options
        Further settings of bokeh's figures.
    """
    from bokeh.plotting import figure

    chosen = {"tools": "box_zoom", "toolbar_location": None, **options}
    plot = figure(x_range=x_range, height=height, sizing_mode="stretch_width", min_width=200, **chosen)
    plot.toolbar.logo = None
    plot.xaxis.axis_label, plot.yaxis.axis_label = x_label or None, y_label or None
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = plot.axis.major_label_text_font_size = "12px"
    plot.axis.axis_label_text_color = plot.axis.major_label_text_color = "#111111"
    plot.outline_line_color = "#111111"
    plot.min_border_left = 72
    return plot


def hover(plot: Any, renderers: list[Any], tooltips: list[tuple[str, str]], mode: str = "mouse") -> None:
    """Tell values under the pointer."""
    from bokeh.models import HoverTool

    plot.add_tools(HoverTool(renderers=renderers, tooltips=tooltips, mode=mode))


def legend_above(plot: Any) -> None:
    """The legend above the figure, where it hides nothing; a click on a name hides its line."""
    legend = plot.legend[0]
    plot.add_layout(legend, "above")
    legend.orientation, legend.click_policy = "horizontal", "hide"
    legend.ncols = 2
    legend.border_line_color, legend.label_text_font_size, legend.padding = None, "12px", 2


def look(number: int) -> dict[str, Any]:
    """Colour and dashes of the n-th line."""
    return {"line_color": COLOURS[number % len(COLOURS)], "line_dash": DASHES[number % len(DASHES)]}
