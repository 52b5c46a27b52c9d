"""Mode shapes: MAC matrix, complex plane, and deformed geometry."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimation import Geometry
from millfrf.core import DegreeOfFreedom, Real
from modal_fit import ModalModel, ModeShapes

from .style import COLOURS, WIDTH_MM, house_style, new_figure, panel_letter

MAX_ANIMATED = 40  # modes that a page animates
_REACH = 0.15  # largest displacement drawn, as a share of the structure's size


@dataclass(frozen=True)
class MovingShapes:
    """Nodes, lines between them, and the motion of each node in each mode.

    Parameters
    ----------
    positions : (n_nodes, 3), m
        Nodes at rest.
    lines
        Pairs of node numbers that a line connects.
    shapes : (n_modes, n_nodes, 3), complex
        Motion of each node, largest displacement 1: ``real(shape exp(i phase))``.
    labels
        Name of each mode, for a list.
    measured : (n_nodes,), bool
        Nodes whose motion is known; the others do not move.
    axes
        Pairs of points (m) of further lines that do not move, such as axes of joints.
    tip
        Number of the marked node, or None.
    """

    positions: Real
    lines: tuple[tuple[int, int], ...]
    shapes: NDArray[np.complex128]
    labels: tuple[str, ...]
    measured: NDArray[np.bool_]
    axes: tuple[tuple[Sequence[float], Sequence[float]], ...] = ()
    tip: int | None = None

    def to_json(self) -> str:
        """Convert to JSON for a page, rounded to a micrometre and four digits of a shape."""
        return json.dumps(
            {
                "positions": self.positions.round(6).tolist(),
                "lines": [list(pair) for pair in self.lines],
                "real": self.shapes.real.round(4).tolist(),
                "imaginary": self.shapes.imag.round(4).tolist() if np.any(self.shapes.imag) else None,
                "labels": list(self.labels),
                "measured": self.measured.tolist(),
                "axes": [[list(start), list(end)] for start, end in self.axes],
                "tip": self.tip,
            }
        )


def moving_shapes(geometry: Geometry, model: ModalModel, shapes: ModeShapes) -> MovingShapes | None:
    """Place mode shapes on the nodes of a geometry; return None if the geometry contains no point of the model.

    The components of a node along its measured directions are added as vectors; there is no motion in directions that
    were not measured.

    Parameters
    ----------
    geometry
        Positions of the nodes, and lines between them.
    model, shapes
        Modal model, and its mode shapes.
    """
    index = {name: k for k, name in enumerate(geometry.nodes)}
    n_modes = min(len(model.poles), MAX_ANIMATED)
    moved = np.zeros((n_modes, len(index), 3), dtype=complex)
    measured = np.zeros(len(index), dtype=bool)
    for column, dof in enumerate(shapes.dofs):
        node = DegreeOfFreedom.parse(dof).node
        if node not in index:
            continue
        measured[index[node]] = True
        moved[:, index[node]] += shapes.vectors[:n_modes, column, None] * geometry.direction(dof)
    if not measured.any():
        return None
    largest = np.linalg.norm(moved, axis=2).max(axis=1)
    moved /= np.maximum(largest, 1e-300)[:, None, None]
    pairs = [(index[a], index[b]) for line in geometry.lines for a, b in pairwise(line)]
    labels = tuple(
        f"{k + 1}: {frequency:.2f} Hz, {100 * zeta:.2f} %"
        for k, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True))
    )
    return MovingShapes(geometry.positions, tuple(pairs), moved, labels[:n_modes], measured)


def shapes_figure(moving: MovingShapes) -> Figure:
    """Draw the six lowest modes at their largest real displacement, with the structure at rest in grey.

    Parameters
    ----------
    moving
        Nodes, lines and mode shapes.
    """
    count = min(6, len(moving.shapes))
    columns = min(3, max(count, 1))
    rows = max(1, -(-count // columns))
    size = float(np.ptp(moving.positions, axis=0).max()) or 1.0
    with house_style():
        figure = new_figure(58.0 * rows)
        panels = figure.subplots(rows, columns, squeeze=False, subplot_kw={"projection": "3d"}).ravel()
        for axes in panels[count:]:
            axes.remove()  # an invisible panel in 3D breaks matplotlib's layout
        for mode in range(count):
            axes = panels[mode]
            displaced = moving.positions + _REACH * size * moving.shapes[mode].real
            for points, colour, width in ((moving.positions, "#c0c0c0", 1.5), (displaced, COLOURS[1], 1.3)):
                for first, second in moving.lines:
                    axes.plot(*points[[first, second]].T, color=colour, linewidth=width)
            axes.scatter(*displaced[moving.measured].T, color=COLOURS[1], s=5, depthshade=False)
            axes.set_title(moving.labels[mode])
            _equal(axes, moving.positions, size)
    return figure


def _equal(axes: object, positions: Real, size: float) -> None:
    """Set the same scale along all axes, and letters for their names."""
    middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
    half = 0.5 * size * (1 + _REACH)
    for name, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"{name}axis").set_ticklabels([])
        getattr(axes, f"set_{name}label")(name, labelpad=-12)
    axes.set_box_aspect((1, 1, 1))  # type: ignore[attr-defined]
    axes.view_init(elev=22, azim=-55)  # type: ignore[attr-defined]


_MAX_NUMBERS = 16  # modes up to which the MAC is written into its cell


def assurance_figure(model: ModalModel, shapes: ModeShapes) -> Figure:
    """Draw the auto-MAC matrix, and beside its rows the modal phase collinearity and the mean phase deviation."""
    n = len(model.poles)
    side = float(np.clip(6.4 * n, 32.0, 90.0))
    height = side + 20.0
    with house_style():
        figure = new_figure(height, None)

        def panel(left: float, width: float) -> Axes:
            return figure.add_axes((left / WIDTH_MM, 12.0 / height, width / WIDTH_MM, side / height))

        matrix, scale = panel(26.0, side), panel(28.0 + side, 3.0)
        width = (178.0 - (46.0 + side)) / 2
        realness = panel(46.0 + side, width - 4), panel(50.0 + side + width, width - 4)
        image = matrix.imshow(shapes.assurance, cmap="Greys", vmin=0, vmax=1, aspect="auto")
        figure.colorbar(image, cax=scale)
        scale.set_title("MAC", pad=7, loc="left")
        _label_matrix(matrix, model, shapes)
        _draw_realness(*realness, shapes)
        for number, axes in enumerate((matrix, *realness)):
            panel_letter(axes, number)
    return figure


def _draw_realness(collinearity: Axes, deviation: Axes, shapes: ModeShapes) -> None:
    """Draw MPC and MPD of each mode, in the rows of the matrix."""
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
    step = max(1, len(rows) // 20 + 1) if len(rows) > _MAX_NUMBERS else 1
    names = [f"{row + 1}: {model.natural_frequencies[row]:.2f} Hz" for row in rows]
    axes.set_yticks(rows[::step], names[::step])
    axes.set_xticks(rows[::step], [str(row + 1) for row in rows[::step]])
    axes.set_xlabel("Mode")
    axes.tick_params(length=0)
    if len(rows) > _MAX_NUMBERS:
        return
    for i in range(len(rows)):
        for j in range(len(rows)):
            value = float(shapes.assurance[i, j])
            colour = "#ffffff" if value > 0.5 else "#000000"
            axes.text(j, i, f"{100 * value:.0f}", ha="center", va="center", fontsize=6, color=colour)


def compass_figure(model: ModalModel, shapes: ModeShapes) -> Figure:
    """Draw the components of each mode in the complex plane.

    Each mode is rotated so that the best line through its components is the real axis."""
    n = len(model.poles)
    columns = min(n, 5)
    lines = -(-n // columns)
    width = (WIDTH_MM - 4) / 5
    with house_style():
        figure = new_figure(lines * (width + 7) + 2, None)
        total = figure.get_figheight() * 25.4
        for mode in range(n):
            row, column = divmod(mode, columns)
            corner = (2 + column * width + 2, total - (row + 1) * (width + 7) + 1)
            position = (corner[0] / WIDTH_MM, corner[1] / total, (width - 4) / WIDTH_MM, (width - 4) / total)
            _compass(figure.add_axes(position), model, shapes, mode)
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
