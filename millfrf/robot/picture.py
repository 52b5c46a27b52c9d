"""Pictures of a robot as files: mode shapes, and maps of deviation over a work area."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.core import writing_whole_file
from millfrf.figures import house_style, new_figure, panel_letter
from millfrf.robot_model import CutPlace, DeviationMap, SpatialCase, close_loops, modes_at

from .shown import mode_page, robot_figure

Real = NDArray[np.float64]


def draw_modes(path: Path, case: SpatialCase, driven: Real) -> None:
    """A picture of the first four modes, or (``.html``) a page on which they move."""
    modes = modes_at(case.robot, close_loops(case.robot.mechanism, driven))
    if path.suffix == ".html":
        with writing_whole_file(path) as temporary:
            temporary.write_text(mode_page(case.name, modes), encoding="utf-8")
        return
    _save(robot_figure(modes), path)


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


def _save(figure: Figure, path: Path) -> None:
    with house_style(), writing_whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:], dpi=200)
