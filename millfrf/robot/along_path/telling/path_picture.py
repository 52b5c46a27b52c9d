"""The picture of an optimised path: depth limit, deviation and redundancy over the way, before and after."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.figures import COLOURS, LINE_STYLES, SHADE, house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import CutPath

from ..path_state import PathState


def draw_path(
    path: Path, cut: CutPath, before: PathState, after: PathState, max_depth: float, planned: float | None
) -> None:
    """Write :func:`path_figure` as ``.png``, ``.pdf`` or ``.svg``."""
    with house_style():
        figure = path_figure(cut, before, after, max_depth, planned)
    save_figure(figure, path)


def path_figure(cut: CutPath, before: PathState, after: PathState, max_depth: float, planned: float | None) -> Figure:
    """Draw depth limits, deviation, margins and angles over the way along the path.

    Parameters
    ----------
    cut
        The path, for the way.
    before, after
        Postures without turning, and those chosen.
    max_depth : m
        Largest depth that was searched: limits at it lie beyond.
    planned : m
        Depth of the planned cut, or None.
    """
    way = 1e3 * cut.lengths
    figure = new_figure(165.0)
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.6, 1.2, 1.0, 1.0))
    _depths(panels[0], way, before, after, max_depth, planned)
    for state, look, name in ((before, 0, "redundancy at zero"), (after, 1, "chosen")):
        style = {"color": COLOURS[look], "linestyle": LINE_STYLES[1 - look]}
        panels[1].plot(way, 1e3 * state.sizes, **style, label=name)
        panels[2].plot(way, np.degrees(state.margin), **style)
    panels[1].set_ylabel("Deviation (mm)")
    panels[1].set_ylim(bottom=0)
    panels[2].set_ylabel("Distance to joint\nlimit (degrees)")
    panels[2].set_ylim(bottom=0)
    panels[3].plot(way, np.degrees(after.tool), color=COLOURS[1], label="about the tool")
    if np.ptp(after.table) > 0 or after.table.any():
        panels[3].plot(way, np.degrees(after.table), color=COLOURS[2], linestyle=LINE_STYLES[2], label="rotary table")
        panels[3].legend(loc="best")
    panels[3].set_ylabel("Turn (degrees)")
    panels[3].set_xlabel("Way along the path (mm)")
    panels[3].set_xlim(way.min(), way.max())
    for number, axes in enumerate(panels):
        panel_letter(axes, number)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _depths(
    axes: Axes, way: np.ndarray, before: PathState, after: PathState, max_depth: float, planned: float | None
) -> None:
    limits = [1e3 * state.values.known_depth(max_depth) for state in (before, after)]
    limits[0] = np.where(before.reached, limits[0], np.nan)
    highest = float(max(np.nanmax(limit, initial=0.0) for limit in limits))
    top = 1.15 * min(1e3 * max_depth, highest) or 1.0
    found = limits[1] < 1e3 * max_depth
    axes.fill_between(way, limits[1], top, where=found, color=SHADE, label="unstable in the chosen postures")
    axes.plot(way, limits[0], color=COLOURS[0], linestyle=LINE_STYLES[1], label="limit, redundancy at zero")
    axes.plot(way, limits[1], color=COLOURS[1], label="limit, chosen postures")
    unsure = np.array([word != "verified" for word in after.values.status])
    if unsure.any():
        axes.plot(way[unsure], limits[1][unsure], "x", color=COLOURS[2], markersize=4, label="not verified")
    if planned is not None:
        axes.axhline(1e3 * planned, color=COLOURS[2], linestyle=LINE_STYLES[2], label=f"planned, {1e3 * planned:g} mm")
    if not found.all():
        axes.axhline(1e3 * max_depth, color=COLOURS[3], linestyle=LINE_STYLES[3], label="searched up to here")
    axes.set_ylabel("Depth of cut (mm)")
    axes.set_ylim(0, top)
