"""The section with maps over poses."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from millfrf.figures import save_figure

from ....report import Picture, Section, picture_of
from ..drift import DAMPING, DEPTH, FREQUENCY, Series
from ..identity import IdentifiedModes
from ..pictures import MapPanel, MapPlane, draw_maps

MOST_MODES = 4
"""Modes that are drawn in one picture, a row each."""


def map_section(folder: Path, series: Sequence[Series], modes: IdentifiedModes, plane: MapPlane, poses: int) -> Section:
    """Maps of frequency, damping and depth limit with their scatter; the pictures are also written as PNG.

    Parameters
    ----------
    folder
        Folder of the PNG files.
    series
        Series of all poses.
    modes
        Which modes are the same, for the most common ones.
    plane
        Where the poses lie.
    poses
        Number of poses in the campaign.
    """
    common = [mode for mode in sorted(modes.frequencies) if 2 * _poses_with(series, mode) >= poses]
    pictures = []
    for start in range(0, len(common), MOST_MODES):
        chosen = common[start : start + MOST_MODES]
        panels = [panel for mode in chosen for panel in _of_mode(series, mode, modes.frequencies[mode])]
        name = "map_modes.png" if not start else f"map_modes_{start // MOST_MODES + 1}.png"
        pictures.append(_picture(folder / name, panels, plane, _modes_caption(plane), "Maps of modes over poses"))
    depth = [one for one in series if one.quantity == DEPTH]
    if depth:
        panels = [
            MapPanel("lowest depth limit (mm)", {one.pose: 1e3 * float(np.exp(one.logs.mean())) for one in depth}),
            MapPanel("its scatter between sets (%)", _scatter(depth)),
        ]
        caption = f"Lowest depth limit over all spindle speeds that were asked for. {_places(plane)}"
        pictures.append(_picture(folder / "map_depth_limit.png", panels, plane, caption, "Map of depth limits"))
    if not pictures:
        return Section("Maps over poses", ("No set has a modal model: there is nothing to map.",))
    return Section("Maps over poses", (), pictures=tuple(pictures))


def _poses_with(series: Sequence[Series], mode: int) -> int:
    return sum(one.mode == mode and one.quantity == FREQUENCY for one in series)


def _of_mode(series: Sequence[Series], mode: int, frequency: float) -> list[MapPanel]:
    """Frequency, its scatter between sets, and damping of one mode."""
    own = [one for one in series if one.mode == mode]
    named = [one for one in own if one.quantity == FREQUENCY]
    damped = [one for one in own if one.quantity == DAMPING]
    return [
        MapPanel(f"mode {mode}: frequency (Hz)", {one.pose: float(np.exp(one.logs.mean())) for one in named}),
        MapPanel(f"mode {mode}: scatter between sets (%)", _scatter(named)),
        MapPanel(f"mode {mode}: damping ratio (%)", {one.pose: 100 * float(np.exp(one.logs.mean())) for one in damped}),
    ]


def _scatter(series: Sequence[Series]) -> Mapping[str, float]:
    """Standard deviation between the sets of each pose, in per cent; a pose of one set has none."""
    return {one.pose: 100 * float(np.std(one.logs, ddof=1)) for one in series if len(one.rows) > 1}


def _picture(path: Path, panels: Sequence[MapPanel], plane: MapPlane, caption: str, alternative: str) -> Picture:
    figure = draw_maps(panels, plane)
    save_figure(figure, path)
    return picture_of(figure, f"{caption} Also {path.name}.", alternative)


def _modes_caption(plane: MapPlane) -> str:
    return (
        "Natural frequency, its standard deviation between the sets of a pose (drift included), and damping ratio, a "
        f"row a mode, mean over the sets of each pose. {_places(plane)}"
    )


def _places(plane: MapPlane) -> str:
    if plane.names:
        return "No two coordinates of the poses are known, so they stand in a row."
    return "A mark a pose; lighter is larger. An empty ring has no value."
