"""Shapes of all modes: the auto-MAC matrix with MPC and MPD beside it, and every vector in the complex plane."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal_fit import ModalModel, ModeShapes

from ..style import WIDTH_MM, house_style, new_figure, panel_letter

_MOST_NUMBERS = 16
"""Modes up to which the MAC stands in its cell as a number."""

_COLUMNS = 5


def assurance_figure(model: ModalModel, shapes: ModeShapes) -> Figure:
    """Auto-MAC in grey, and in the same rows modal phase collinearity and mean phase deviation."""
    n = len(model.poles)
    side = float(np.clip(6.4 * n, 32.0, 90.0))
    height = side + 20.0
    with house_style():
        figure = new_figure(height, None)

        def panel(left: float, width: float) -> Axes:
            return figure.add_axes((left / WIDTH_MM, 12.0 / height, width / WIDTH_MM, side / height))

        matrix, scale = panel(26.0, side), panel(28.0 + side, 3.0)
        rest = 178.0 - (46.0 + side)
        beside = panel(46.0 + side, rest / 2 - 4), panel(50.0 + side + rest / 2, rest / 2 - 4)
        image = matrix.imshow(shapes.assurance, cmap="Greys", vmin=0, vmax=1, aspect="auto")
        figure.colorbar(image, cax=scale)
        scale.set_title("MAC", pad=7, loc="left")
        _label_matrix(matrix, model, shapes)
        _draw_realness(*beside, shapes)
        for number, axes in enumerate((matrix, *beside)):
            panel_letter(axes, number)
    return figure


def _draw_realness(collinearity: Axes, deviation: Axes, shapes: ModeShapes) -> None:
    """MPC and MPD of each mode, in the rows of the matrix."""
    n = len(shapes.collinearity)
    rows = np.arange(n)
    degrees = np.degrees(shapes.deviation)
    collinearity.plot(shapes.collinearity, rows, "o", color="#000000", markersize=3.5)
    collinearity.set_xlim(min(0.5, 0.95 * float(shapes.collinearity.min(initial=1.0))), 1.04)
    collinearity.set_xlabel("MPC (1)")
    deviation.plot(degrees, rows, "o", color="#000000", markersize=3.5)
    deviation.set_xlim(0, max(10.0, 1.15 * float(degrees.max(initial=0.0))))
    deviation.set_xlabel("MPD (°)")
    for axes in (collinearity, deviation):
        axes.set_ylim(n - 0.5, -0.5)
        axes.set_yticks(rows, [""] * n)


def _label_matrix(axes: Axes, model: ModalModel, shapes: ModeShapes) -> None:
    rows = np.arange(len(model.poles))
    axes.grid(visible=False)
    step = max(1, len(rows) // 20 + 1) if len(rows) > _MOST_NUMBERS else 1
    names = [f"{row + 1}: {model.natural_frequencies[row]:.2f} Hz" for row in rows]
    axes.set_yticks(rows[::step], names[::step])
    axes.set_xticks(rows[::step], [str(row + 1) for row in rows[::step]])
    axes.set_xlabel("Mode")
    axes.tick_params(length=0)
    if len(rows) > _MOST_NUMBERS:
        return
    for i in range(len(rows)):
        for j in range(len(rows)):
            value = float(shapes.assurance[i, j])
            colour = "#ffffff" if value > 0.5 else "#000000"
            axes.text(j, i, f"{100 * value:.0f}", ha="center", va="center", fontsize=6, color=colour)


def compass_figure(model: ModalModel, shapes: ModeShapes) -> Figure:
    """Each mode's components in the complex plane, turned to their best line; a real mode lies on the real axis."""
    n = len(model.poles)
    columns = min(n, _COLUMNS)
    lines = -(-n // columns)
    width = (WIDTH_MM - 4) / _COLUMNS
    with house_style():
        figure = new_figure(lines * (width + 7) + 2, None)
        total = figure.get_figheight() * 25.4
        for mode in range(n):
            row, column = divmod(mode, columns)
            corner = (2 + column * width + 2, total - (row + 1) * (width + 7) + 1)
            place = (corner[0] / WIDTH_MM, corner[1] / total, (width - 4) / WIDTH_MM, (width - 4) / total)
            _compass(figure.add_axes(place), model, shapes, mode)
    return figure


def _compass(axes: Axes, model: ModalModel, shapes: ModeShapes, mode: int) -> None:
    vector = shapes.vectors[mode]
    circle = np.exp(1j * np.linspace(0, 2 * np.pi, 181))
    axes.plot(circle.real, circle.imag, color="#000000", linewidth=0.6)
    for across, up in (((-1, 1), (0, 0)), ((0, 0), (-1, 1))):
        axes.plot(across, up, color="#c8c8c8", linewidth=0.5, zorder=1)
    broken = np.full(3 * len(vector), np.nan + 0j)
    broken[::3], broken[1::3] = 0.0, vector
    axes.plot(broken.real, broken.imag, color="#808080", linewidth=0.5)
    axes.plot(vector.real, vector.imag, ".", color="#000000", markersize=3)
    axes.set_title(f"{mode + 1}: {model.natural_frequencies[mode]:.2f} Hz", pad=2)
    axes.set_aspect("equal")
    axes.set_xlim(-1.06, 1.06)
    axes.set_ylim(-1.06, 1.06)
    axes.set_axis_off()
