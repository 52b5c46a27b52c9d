"""A robot at rest and its mode shapes as a figure."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.figures import COLOURS, house_style, new_figure
from millfrf.robot_model import StructureModes

Real = NDArray[np.float64]

_SHOWN = 0.25
"""Largest displacement drawn, m."""

_REST = "0.78"
"""Grey of the robot at rest."""


def skeleton(modes: StructureModes) -> list[tuple[int, int]]:
    """Pairs of nodes that a line joins: beams and rigid links."""
    return [*(beam.nodes for beam in modes.structure.beams), *modes.structure.rigid]


def exaggeration(modes: StructureModes, mode: int) -> float:
    """Factor that makes the largest displacement of a mode 0.25 m."""
    return float(_SHOWN / max(np.linalg.norm(modes.shapes[mode, :, :3], axis=1).max(), 1e-300))


def robot_figure(modes: StructureModes, n_modes: int = 4) -> Figure:
    """The robot at rest in grey and its lowest mode shapes in colour, largest displacement 0.25 m.

    Above from the front left, below from above: what swings sideways shows in one of them.
    """
    with house_style():
        figure = new_figure(105.0, layout=None)
        shown = min(n_modes, len(modes.squares))
        for mode in range(shown):
            moved = modes.structure.positions + exaggeration(modes, mode) * modes.shapes[mode, :, :3]
            left, width = 0.04 + mode * 0.95 / shown, 0.95 / shown
            upper = figure.add_axes((left, 0.42, width, 0.55), projection="3d")
            _lines(upper, modes, modes.structure.positions, _REST, 3.0)
            _lines(upper, modes, moved, COLOURS[1], 1.3)
            _equal_axes(upper, modes.structure.positions)
            title = f"mode {mode + 1}, {modes.frequencies[mode]:.1f} Hz"
            figure.text(left + 0.5 * width, 0.98, title, ha="center", va="top")
            lower = figure.add_axes((left + 0.03, 0.11, width - 0.05, 0.30))
            _from_above(lower, modes, moved)
            if mode == 0:
                lower.set_ylabel("y (m)")
    return figure


def _from_above(axes: Axes, modes: StructureModes, moved: Real) -> None:
    """The same from above, x to the right."""
    for positions, colour, width in ((modes.structure.positions, _REST, 3.0), (moved, COLOURS[1], 1.3)):
        for first, second in skeleton(modes):
            axes.plot(*positions[[first, second]][:, :2].T, color=colour, linewidth=width, marker="o", markersize=2)
    rest = modes.structure.positions
    middle = (rest.max(axis=0) + rest.min(axis=0)) / 2
    half = max(float(np.ptp(rest[:, :2], axis=0).max()) / 2 + 1.2 * _SHOWN, 0.4)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")


def _lines(axes: Axes, modes: StructureModes, positions: Real, colour: str, width: float) -> None:
    for first, second in skeleton(modes):
        axes.plot(*positions[[first, second]].T, color=colour, linewidth=width, marker="o", markersize=2)


def _equal_axes(axes: Axes, positions: Real) -> None:
    middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
    half = np.ptp(positions, axis=0).max() / 2 + _SHOWN
    for name, centre in zip(("x", "y", "z"), middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"{name}axis").set_ticklabels([])
        getattr(axes, f"set_{name}label")(name, labelpad=-12)
    axes.set_box_aspect((1, 1, 1), zoom=1.1)  # type: ignore[arg-type, call-arg]
    axes.view_init(elev=18, azim=-50)  # type: ignore[attr-defined]
