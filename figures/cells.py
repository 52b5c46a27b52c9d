"""Maps of cells as small pictures: one image for a panel instead of a shape for every cell."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.image import AxesImage
from numpy.typing import NDArray

Real = NDArray[np.float64]

PIXELS = 600
"""Pixels along an axis on which the cells have different widths: less than a tenth of a millimetre each."""

LEAST_PIXELS = 150
"""Pixels along an axis on which all cells have one width, so that viewers which smooth pictures blur no edge."""


def draw_cells(axes: Axes, x_edges: Real, y_edges: Real, values: Real, shades: Normalize, cmap: str) -> None:
    """Draw cells as one picture, which is placed by the scales and limits that the axes have at the call.

    Parameters
    ----------
    axes
        Axes with linear or logarithmic scales; their limits are set before.
    x_edges, y_edges : (n_x + 1,), (n_y + 1,)
        Edges of the cells along both axes.
    values : (n_x, n_y)
        A value for each cell.
    shades, cmap
        Scale of the values, and its colours.
    """
    left, right, columns = _sampled(_fractions(axes, "x", x_edges))
    bottom, top, rows = _sampled(_fractions(axes, "y", y_edges))
    image = AxesImage(axes, cmap=cmap, norm=shades, interpolation="none", origin="lower", zorder=0.5)
    image.set_data(values[np.ix_(columns, rows)].T)
    image.set_transform(axes.transAxes)  # a picture cannot be stretched along a logarithmic axis
    image.set_clip_path(axes.patch)
    image.set_extent((left, right, bottom, top))
    axes.add_image(image)


def _fractions(axes: Axes, side: str, edges: Real) -> Real:
    """Places of the edges as shares of the axes' width or height."""
    low, high = getattr(axes, f"get_{side}lim")()
    if getattr(axes, f"get_{side}scale")() == "log":
        low, high, edges = np.log(low), np.log(high), np.log(edges)
    return np.asarray((edges - low) / (high - low))


def _sampled(edges: Real) -> tuple[float, float, NDArray[np.int64]]:
    """Lower and upper end of cells, and the number of the cell that each pixel between them shows."""
    widths = np.diff(edges)
    if np.allclose(widths, widths[0], rtol=1e-3):
        place = np.repeat(np.arange(len(widths)), -(-LEAST_PIXELS // len(widths)))
    else:
        middles = (np.arange(PIXELS) + 0.5) / PIXELS
        place = np.searchsorted((edges[1:-1] - edges[0]) / (edges[-1] - edges[0]), middles)
    low, high = float(edges[0]), float(edges[-1])
    return (low, high, place) if low < high else (high, low, place[::-1])
