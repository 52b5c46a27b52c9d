"""Pictures of a robot: its structure and mode shapes, and maps of deviation over a work area."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from figures import COLOURS, house_style, new_figure, panel_letter
from foundation import writing_whole_file
from robot_model import CutPlace, DeviationMap, SpatialCase, StructureModes, close_loops, modes_at

from .mode_page import mode_page

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


def draw_modes(path: Path, case: SpatialCase, driven: Real) -> None:
    """A picture of the first four modes, or (``.html``) a page on which they move."""
    modes = modes_at(case.robot, close_loops(case.robot.mechanism, driven))
    if path.suffix == ".html":
        with writing_whole_file(path) as temporary:
            temporary.write_text(mode_page(case.name, modes, skeleton(modes)), encoding="utf-8")
        return
    _save(robot_figure(modes), path)


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


def draw_deviation(path: Path, found: DeviationMap, shape: tuple[int, int], needed: Real, least: str = "") -> None:
    """Deviation under thrust and the position tolerance that holes need, mm; white where not reached."""
    _save(deviation_figure(found, shape, needed, least), path)


def deviation_figure(found: DeviationMap, shape: tuple[int, int], needed: Real, least: str = "") -> Figure:
    """Draw a deviation map and the position tolerance that each hole needs.

    Parameters
    ----------
    found
        Deviation map of the robot.
    shape
        Number of places along x and y.
    needed : (n,), m
        Position tolerance that each hole needs.
    least
        Text ``at least `` where parts of the budget are unknown, for the label.
    """
    sizes = 1e3 * np.linalg.norm(found.deviations, axis=1)
    fields = [
        (sizes, "deviation under thrust (mm)"),
        (1e3 * needed, f"position tolerance, {least}(mm)" if least else "position tolerance (mm)"),
    ]
    return map_figure(found.positions, shape, fields)


def draw_workspace(path: Path, places: Sequence[CutPlace], shape: tuple[int, int], lowest: Real, limits: Real) -> None:
    """Lowest frequency (Hz) over y and x, and beside it the depth limit (mm) where there is one."""
    fields = [(lowest, "lowest natural frequency (Hz)")]
    if np.isfinite(limits).any():
        fields.append((1e3 * limits, "depth limit (mm)"))
    _save(map_figure(np.array([place.position for place in places]), shape, fields), path)


def map_figure(positions: Real, shape: tuple[int, int], fields: Sequence[tuple[Real, str]]) -> Figure:
    """Draw fields over y (across) and x (reach), with contours that carry their values; white where not reached.

    Parameters
    ----------
    positions : (n, 3), m
        Positions of the places in the base frame.
    shape
        Number of places along x and y.
    fields
        Values (n,) and label with unit, one a panel.
    """
    x, y = (positions[:, axis].reshape(shape) for axis in (0, 1))
    tall = float(np.ptp(x)) / max(float(np.ptp(y)), 1e-9)
    with house_style():
        figure = new_figure(float(np.clip(150.0 / len(fields) * tall + 18.0, 55.0, 120.0)))
        figure.set_layout_engine("compressed")
        panels = figure.subplots(1, len(fields), squeeze=False)[0]
        for number, (axes, (field, label)) in enumerate(zip(panels, fields, strict=True)):
            shown = np.ma.masked_invalid(field.reshape(shape))
            drawn = axes.pcolormesh(y, x, shown, shading="nearest", cmap="viridis")
            if min(shape) > 2 and shown.count() > 8 and np.ptp(shown.compressed()) > 0:
                lines = axes.contour(y, x, shown, 6, colors="white", linewidths=0.7)
                axes.clabel(lines, fontsize=7)
            figure.colorbar(drawn, ax=axes, label=label, pad=0.02)
            axes.set_xlabel("y (m)")
            axes.set_ylabel("x (m)")
            axes.set_aspect("equal")
            axes.grid(visible=False)
            if len(fields) > 1:
                panel_letter(axes, number)
    return figure


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


def _save(figure: Figure, path: Path) -> None:
    with house_style(), writing_whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=200)
