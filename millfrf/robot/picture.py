"""Pictures of a robot: its structure and mode shapes, and maps of deviation over a work area."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from foundation import writing_whole_file
from robot_model import CutPlace, DeviationMap, SpatialCase, StructureModes, close_loops, modes_at

from ..figures.style import COLOURS, SHADE, house_style, new_figure
from .mode_page import mode_page

Real = NDArray[np.float64]

_SHOWN = 0.25
"""Largest displacement drawn, m."""


def skeleton(modes: StructureModes) -> list[tuple[int, int]]:
    """Pairs of nodes that a line joins: beams and rigid links."""
    return [*(beam.nodes for beam in modes.structure.beams), *modes.structure.rigid]


def exaggeration(modes: StructureModes, mode: int) -> float:
    """Factor that makes the largest displacement of a mode 0.25 m."""
    return float(_SHOWN / max(np.linalg.norm(modes.shapes[mode, :, :3], axis=1).max(), 1e-300))


def draw_modes(path: Path, case: SpatialCase, driven: Real) -> None:
    """A picture of the first four modes, or (``.html``) a page on which they move."""
    modes = modes_at(case.robot, close_loops(case.robot.mechanism, driven))
    if path.suffix == ".html":
        with writing_whole_file(path) as temporary:
            temporary.write_text(mode_page(case.name, modes, skeleton(modes)), encoding="utf-8")
        return
    _save(robot_figure(modes), path)


def robot_figure(modes: StructureModes, n_modes: int = 4) -> Figure:
    """The robot at rest in grey and its lowest mode shapes in colour, largest displacement 0.25 m."""
    with house_style():
        figure = new_figure(70.0)
        shown = min(n_modes, len(modes.squares))
        for mode in range(shown):
            axes = figure.add_subplot(1, shown, mode + 1, projection="3d")
            moved = modes.structure.positions + exaggeration(modes, mode) * modes.shapes[mode, :, :3]
            _lines(axes, modes, modes.structure.positions, SHADE, 3.0)
            _lines(axes, modes, moved, COLOURS[1], 1.2)
            axes.set_title(f"Mode {mode + 1}, {modes.frequencies[mode]:.1f} Hz")
            _equal_axes(axes, modes.structure.positions)
    return figure


def draw_deviation(path: Path, found: DeviationMap, shape: tuple[int, int]) -> None:
    """Length of the deviation over y (across) and x (reach), mm; white where not reached."""
    _save(deviation_figure(found, shape), path)


def deviation_figure(found: DeviationMap, shape: tuple[int, int]) -> Figure:
    """The same as a figure; ``shape``: how many places along x and y."""
    sizes = 1e3 * np.linalg.norm(found.deviations, axis=1).reshape(shape)
    x, y = (found.positions[:, axis].reshape(shape) for axis in (0, 1))
    with house_style():
        figure = new_figure(80.0)
        axes = figure.subplots()
        drawn = axes.pcolormesh(y, x, np.ma.masked_invalid(sizes), shading="nearest", cmap="viridis")
        figure.colorbar(drawn, ax=axes, label="deviation (mm)")
        axes.set_xlabel("y (m)")
        axes.set_ylabel("x (m)")
        axes.set_aspect("equal")
    return figure


def draw_workspace(path: Path, places: Sequence[CutPlace], shape: tuple[int, int], lowest: Real, limits: Real) -> None:
    """Lowest frequency (Hz) over y and x, and beside it the depth limit (mm) where there is one."""
    positions = np.array([place.position for place in places])
    x, y = (positions[:, axis].reshape(shape) for axis in (0, 1))
    fields = [(lowest, "lowest frequency (Hz)")]
    if np.isfinite(limits).any():
        fields.append((1e3 * limits, "depth limit (mm)"))
    with house_style():
        figure = new_figure(75.0)
        panels = figure.subplots(1, len(fields), squeeze=False)[0]
        for axes, (field, label) in zip(panels, fields, strict=True):
            shown = np.ma.masked_invalid(field.reshape(shape))
            drawn = axes.pcolormesh(y, x, shown, shading="nearest", cmap="viridis")
            figure.colorbar(drawn, ax=axes, label=label)
            axes.set_xlabel("y (m)")
            axes.set_ylabel("x (m)")
            axes.set_aspect("equal")
    _save(figure, path)


def _lines(axes: Axes, modes: StructureModes, positions: Real, colour: str, width: float) -> None:
    for first, second in skeleton(modes):
        axes.plot(*positions[[first, second]].T, color=colour, linewidth=width, marker="o", markersize=2)


def _equal_axes(axes: Axes, positions: Real) -> None:
    middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
    half = np.ptp(positions, axis=0).max() / 2 + _SHOWN
    for name, centre in zip(("x", "y", "z"), middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"set_{name}ticks")([])
    axes.set_box_aspect((1, 1, 1))  # type: ignore[arg-type]


def _save(figure: Figure, path: Path) -> None:
    with house_style(), writing_whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=200)
