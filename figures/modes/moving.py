"""Mode shapes on a geometry: what a page moves, and a picture of it for paper."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimation import Geometry
from foundation import DegreeOfFreedom
from modal_fit import ModalModel, ModeShapes

from ..style import COLOURS, house_style, new_figure

MOST_SHAPES = 40
"""Modes that a page moves."""

_DRAWN = 6
"""Modes of the picture."""

_REACH = 0.15
"""Largest displacement drawn, as a share of the structure's size."""

Real = NDArray[np.float64]


@dataclass(frozen=True)
class MovingShapes:
    """Nodes, lines between them, and how far each node moves in each mode.

    Parameters
    ----------
    positions : (n_nodes, 3), m
        Nodes at rest.
    lines
        Pairs of node numbers that a line joins.
    shapes : (n_modes, n_nodes, 3), complex
        Motion of each node, largest displacement 1: ``real(shape exp(i phase))``.
    labels
        Name of each mode, for a list.
    measured : (n_nodes,), bool
        Nodes whose motion is known; the others stay where they are.
    axes
        Pairs of points (m) of further lines that do not move, such as axes of joints.
    tip
        Number of the node that is marked, or None.
    """

    positions: Real
    lines: tuple[tuple[int, int], ...]
    shapes: NDArray[np.complex128]
    labels: tuple[str, ...]
    measured: NDArray[np.bool_]
    axes: tuple[tuple[Sequence[float], Sequence[float]], ...] = ()
    tip: int | None = None

    def to_json(self) -> str:
        """All of it as text for a page, a micrometre and four digits of a shape."""
        return json.dumps(
            {
                "positions": self.positions.round(6).tolist(),
                "lines": [list(pair) for pair in self.lines],
                "real": self.shapes.real.round(4).tolist(),
                "imaginary": self.shapes.imag.round(4).tolist() if np.any(self.shapes.imag) else None,
                "labels": list(self.labels),
                "measured": self.measured.tolist(),
                "axes": [[list(one), list(other)] for one, other in self.axes],
                "tip": self.tip,
            }
        )


def moving_shapes(geometry: Geometry, model: ModalModel, shapes: ModeShapes) -> MovingShapes | None:
    """Mode shapes on the nodes of a geometry; None where it knows none of the model's points.

    The components of a node along its measured directions are added up as vectors; a direction that was not measured
    does not move, and neither does a node without any.

    Parameters
    ----------
    geometry
        Places of the nodes, and lines between them.
    model, shapes
        Modal model, and its shapes.
    """
    place = {name: k for k, name in enumerate(geometry.nodes)}
    n_modes = min(len(model.poles), MOST_SHAPES)
    moved = np.zeros((n_modes, len(place), 3), dtype=complex)
    measured = np.zeros(len(place), dtype=bool)
    for column, dof in enumerate(shapes.dofs):
        node = DegreeOfFreedom.parse(dof).node
        if node not in place:
            continue
        measured[place[node]] = True
        moved[:, place[node]] += shapes.vectors[:n_modes, column, None] * geometry.direction(dof)
    if not measured.any():
        return None
    largest = np.linalg.norm(moved, axis=2).max(axis=1)
    moved /= np.maximum(largest, 1e-300)[:, None, None]
    pairs = [(place[a], place[b]) for line in geometry.lines for a, b in pairwise(line)]
    labels = tuple(
        f"{k + 1}: {frequency:.2f} Hz, {100 * zeta:.2f} %"
        for k, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True))
    )
    return MovingShapes(geometry.positions, tuple(pairs), moved, labels[:n_modes], measured)


def shapes_figure(moving: MovingShapes) -> Figure:
    """The lowest six modes at their largest real displacement, over the structure at rest in grey.

    Parameters
    ----------
    moving
        Nodes, lines and shapes.
    """
    count = min(_DRAWN, len(moving.shapes))
    columns = min(3, max(count, 1))
    rows = max(1, -(-count // columns))
    size = float(np.ptp(moving.positions, axis=0).max()) or 1.0
    with house_style():
        figure = new_figure(58.0 * rows)
        panels = figure.subplots(rows, columns, squeeze=False, subplot_kw={"projection": "3d"}).ravel()
        for axes in panels[count:]:
            axes.set_visible(False)
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
    """The same scale along all axes, and letters for their names."""
    middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
    half = 0.5 * size * (1 + _REACH)
    for name, centre in zip("xyz", middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"{name}axis").set_ticklabels([])
        getattr(axes, f"set_{name}label")(name, labelpad=-12)
    axes.set_box_aspect((1, 1, 1))  # type: ignore[attr-defined]
    axes.view_init(elev=22, azim=-55)  # type: ignore[attr-defined]
