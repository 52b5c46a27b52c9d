"""Cells drawn as one picture look like the same cells drawn one by one."""

import numpy as np
import pytest
from matplotlib.colors import LogNorm

from millfrf.figures import house_style, new_figure
from millfrf.figures.diagnosis_maps import draw_cells

SHADES = LogNorm(1.0, 100.0, clip=True)


def _pixels(draw: str, scale: str, upside_down: bool, x: np.ndarray, y: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Grey levels of a figure whose axes, a little wider than the cells, fill it."""
    with house_style():
        figure = new_figure(90.0, None)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_axis_off()
        axes.set_yscale(scale)
        axes.set_xlim(x[0] - 0.3, x[-1] + 0.5)
        axes.set_ylim(*((y[-1], 0.9 * y[0]) if upside_down else (0.9 * y[0], y[-1])))
        if draw == "one by one":
            axes.pcolormesh(x, y, values.T, norm=SHADES, cmap="Greys")
        else:
            draw_cells(axes, x, y, values, SHADES, "Greys")
        figure.canvas.draw()
        return np.asarray(figure.canvas.buffer_rgba())[:, :, 0].astype(float)


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("scale", ["linear", "log"])
def test_picture_agrees_with_cells_drawn_one_by_one(scale: str, upside_down: bool) -> None:
    x, y = np.linspace(2.0, 9.0, 8), np.array([4.0, 5.0, 6.5, 7.0, 20.0, 33.0])
    values = 10 ** np.random.default_rng(1).uniform(0, 2, (7, 5))
    truth, result = (_pixels(way, scale, upside_down, x, y, values) for way in ("one by one", "one picture"))
    assert truth.std() > 40
    assert np.mean(np.abs(truth - result) > 3) < 0.03  # edges of cells alone, a pixel aside
