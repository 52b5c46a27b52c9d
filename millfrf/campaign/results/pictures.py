"""Pictures of a campaign: maps over poses, trends."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from millfrf.core import InputError, Real
from millfrf.figures import COLOURS, SHADE, house_style, new_figure, panel_letter
from millfrf.robot_model import PlanarCase, close_loops, read_robot

from .drift import Drift
from .sets import SetResults
from .trends import Series, Trend

LEAST_SPREAD = 1e-3
"""Range of positions (m) or joint values (rad, m) below which all poses lie on one line of a map."""


@dataclass(frozen=True)
class MapPlane:
    """Two coordinates of each pose.

    Parameters
    ----------
    places : (2,)
        Coordinates of each pose by its name.
    labels
        Labels of the two axes, with units.
    names
        Whether the axis is a row of names: no posture is known, or only one pose.
    """

    places: Mapping[str, Real]
    labels: tuple[str, str]
    names: bool = False


def tip_positions(robot: str | None, sets: Sequence[SetResults]) -> tuple[dict[str, Real], str]:
    """Position of the tool tip in the base frame of every set whose posture is known, m, (3,), by the set's name.

    Parameters
    ----------
    robot
        Name of a robot that ships, or its file, or None.
    sets
        Sets of the campaign, as read.

    Returns
    -------
    Positions, and one line that says why there are none where there should be some.
    """
    if robot is None:
        return {}, ""
    try:
        case = read_robot(robot)
        if isinstance(case, PlanarCase):
            return {}, ""
        mechanism = case.robot.mechanism
        tool = mechanism.index(mechanism.tool)
        found = {
            one.name: mechanism.transforms(close_loops(mechanism, np.array(one.measured.posture)))[tool, :3, 3]
            for one in sets
            if one.measured.posture is not None
        }
    except InputError as error:
        return {}, f"maps are not over places of the tool: {error}"
    return found, ""


def map_plane(sets: Sequence[SetResults], places: Mapping[str, Real]) -> MapPlane:
    """Choose the plane on which poses are shown.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    places : (3,), m
        Position of the tool tip by the name of the set.
    """
    poses = sorted({one.measured.pose for one in sets})
    tips = {one.measured.pose: places[one.name] for one in sets if one.name in places}
    if len(tips) == len(poses):
        chosen = _widest(np.array([tips[pose] for pose in poses]))
        if chosen is not None:
            named = tuple(f"tool tip {'xyz'[k]} (m)" for k in chosen)
            return MapPlane({pose: tips[pose][list(chosen)] for pose in poses}, (named[0], named[1]))
    joints = {one.measured.pose: one.measured.posture for one in sets if one.measured.posture is not None}
    if len(joints) == len(poses) and len({len(one) for one in joints.values()}) == 1:
        chosen = _widest(np.array([joints[pose] for pose in poses]))
        if chosen is not None:
            values = {pose: np.array(joints[pose])[list(chosen)] for pose in poses}
            return MapPlane(values, (f"joint {chosen[0] + 1} (rad or m)", f"joint {chosen[1] + 1} (rad or m)"))
    row = {pose: np.array([float(k), 0.0]) for k, pose in enumerate(poses)}
    return MapPlane(row, ("pose", ""), names=True)


def _widest(positions: Real) -> tuple[int, int] | None:
    """Numbers of the two coordinates that vary most, in their order; None where fewer than one varies."""
    if positions.shape[1] < 2 or len(positions) < 2:
        return None
    spread = np.ptp(positions, axis=0)
    first, second = sorted(np.argsort(-spread, kind="stable")[:2].tolist())
    return (first, second) if spread.max() > LEAST_SPREAD else None


TREND_COLUMNS, TREND_ROW_MM = 2, 58.0

MOST_PANELS = 8
"""Drifts that are drawn, the most certain ones."""


def draw_trends(drifts: Sequence[Drift], every: Sequence[Trend], words: Sequence[tuple[str, str]]) -> Figure:
    """Draw the first drifts, two in a row.

    Parameters
    ----------
    drifts
        Drifts to draw.
    every
        All trends that were looked at, for the other poses.
    words
        Title and label of the x axis of each drift.
    """
    shown = list(drifts[:MOST_PANELS])
    columns = min(TREND_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    with house_style():
        figure = new_figure(rows * TREND_ROW_MM + 4.0)
        figure.set_figwidth(figure.get_figwidth() * columns / TREND_COLUMNS)
        axes = figure.subplots(rows, columns, squeeze=False)
        for k, place in enumerate(axes.ravel()):
            if k >= len(shown):
                place.set_visible(False)
                continue
            _trend_panel(place, shown[k].trend, every)
            if len(shown) > 1:
                panel_letter(place, k)
            place.set_title(words[k][0])
            place.set_xlabel(words[k][1])
            place.set_ylabel("change from the pose's mean (%)")
    return figure


def _trend_panel(axes: Axes, trend: Trend, every: Sequence[Trend]) -> None:
    own = trend.series
    for one in every:
        same = (one.series.mode, one.series.quantity, one.label) == (own.mode, own.quantity, trend.label)
        if same and one.series.pose != own.pose:
            x, y, _ = _points(one)
            axes.plot(x, y, "-", color=SHADE, linewidth=0.8, zorder=1)
    x, y, spread = _points(trend)
    line = np.linspace(x.min(), x.max(), 50)
    middle = 100 * np.expm1(trend.slope * (line - trend.values.mean()))
    band = 100 * scipy.stats.t.ppf(0.975, trend.freedom) * trend.error * np.abs(line - trend.values.mean())
    axes.fill_between(line, middle - band, middle + band, color=COLOURS[2], alpha=0.25, linewidth=0, zorder=2)
    axes.plot(line, middle, color=COLOURS[2], zorder=3)
    axes.errorbar(x, y, 2 * spread, fmt="o", color="black", markersize=3.5, elinewidth=0.8, capsize=2, zorder=4)
    axes.margins(x=0.08)
    if np.all(trend.values == np.round(trend.values)):
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))


def _points(trend: Trend) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Label, deviation from the mean and stated standard error of the sets, the last two in per cent."""
    series: Series = trend.series
    chosen = np.array([row in trend.rows for row in series.rows])
    logs = series.logs[chosen]
    order = np.argsort(trend.values, kind="stable")
    return trend.values[order], 100 * np.expm1(logs - logs.mean())[order], 100 * series.errors[chosen][order]


PANEL = (112.0, 95.0)
"""Room of the marks in a panel, points."""

MARK, LETTER, HEIGHT = 7.0, 3.9, 6.5
"""Sizes of a mark, of a letter's width and of a line, points."""


def free_sides(places: Real, texts: Sequence[str]) -> list[tuple[float, float] | None]:
    """Place of each text beside its mark, points; None where each side is taken.

    Parameters
    ----------
    places : (n, 2)
        Places of the marks, in any unit.
    texts
        What is written beside each.

    Examples
    --------
    >>> free_sides(np.array([[0.0, 0.0], [1.0, 1.0]]), ["1.2", "3.4"])
    [(0.0, 7.0), (0.0, 7.0)]
    """
    span = np.ptp(places, axis=0)
    at = (places - places.min(axis=0)) / np.where(span > 0, span, 1.0) * PANEL
    taken = [(*one, MARK, MARK) for one in at]
    found: list[tuple[float, float] | None] = []
    for number, text in enumerate(texts):
        size = (LETTER * len(text), HEIGHT)
        others = [box for k, box in enumerate(taken) if k != number]
        boxes = {side: (*(at[number] + side), *size) for side in _sides(size[0])}
        free = [side for side, own in boxes.items() if not any(_meet(own, box) for box in others)]
        found.append(free[0] if free else None)
        if free:
            taken.append((*(at[number] + free[0]), *size))
    return found


def _sides(width: float) -> tuple[tuple[float, float], ...]:
    """Middle of a text from the mark, points: above, below, right, left."""
    beside = (MARK + width) / 2 + 1.0
    return (0.0, 7.0), (0.0, -7.0), (beside, 0.0), (-beside, 0.0)


def _meet(one: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two boxes (middle, width, height) cover each other."""
    return abs(one[0] - other[0]) < (one[2] + other[2]) / 2 and abs(one[1] - other[1]) < (one[3] + other[3]) / 2


SHADES = "cividis"
"""Rises in lightness from end to end, and looks the same to the colour blind."""

MAP_COLUMNS, MAP_ROW_MM = 3, 62.0

MOST_WRITTEN = 24
"""Poses up to which each value is written beside its mark."""


@dataclass(frozen=True)
class MapPanel:
    """One quantity over poses.

    Parameters
    ----------
    title
        Name of the quantity with its unit.
    values
        Value by the name of the pose; a pose without one is an empty ring.
    """

    title: str
    values: Mapping[str, float]


def draw_maps(panels: Sequence[MapPanel], plane: MapPlane) -> Figure:
    """Draw panels in rows of three; fewer panels make a narrower picture.

    Parameters
    ----------
    panels
        Quantities to draw.
    plane
        Where the poses lie.
    """
    columns = min(MAP_COLUMNS, len(panels))
    rows = -(-len(panels) // columns)
    with house_style():
        figure = new_figure(rows * MAP_ROW_MM + 4.0)
        figure.set_figwidth(figure.get_figwidth() * columns / MAP_COLUMNS)
        axes = figure.subplots(rows, columns, squeeze=False)
        for k, place in enumerate(axes.ravel()):
            if k >= len(panels):
                place.set_visible(False)
                continue
            _map_panel(figure, place, panels[k], plane)
            place.set_xlabel(plane.labels[0])
            if k % columns == 0 and not plane.names:
                place.set_ylabel(plane.labels[1])
    return figure


def _map_panel(figure: Figure, axes: Axes, panel: MapPanel, plane: MapPlane) -> None:
    known = [pose for pose in plane.places if np.isfinite(panel.values.get(pose, np.nan))]
    missing = [pose for pose in plane.places if pose not in known]
    axes.set_title(panel.title)
    if plane.names:
        _named(axes, panel, plane, known)
        return
    at = np.array([plane.places[pose] for pose in known]).reshape(-1, 2)
    values = [panel.values[pose] for pose in known]
    if missing:
        empty = np.array([plane.places[pose] for pose in missing])
        axes.plot(empty[:, 0], empty[:, 1], "o", markerfacecolor="none", markeredgecolor="0.5", markersize=6)
    if known:
        marks = axes.scatter(at[:, 0], at[:, 1], c=values, cmap=SHADES, s=42, edgecolors="black", linewidths=0.5)
        bar = figure.colorbar(marks, ax=axes, location="bottom", ticks=MaxNLocator(5), shrink=0.9, aspect=28, pad=0.02)
        bar.ax.tick_params(labelsize=7)
    if known and len(known) <= MOST_WRITTEN:
        texts = [f"{value:.{_digits(values)}f}" for value in values]
        for place, text, side in zip(at, texts, free_sides(at, texts), strict=True):
            if side is not None:
                x, y = place
                axes.annotate(text, (x, y), side, textcoords="offset points", ha="center", va="center", fontsize=6)
    axes.margins(0.14)
    axes.locator_params(nbins=5)


def _named(axes: Axes, panel: MapPanel, plane: MapPlane, known: Sequence[str]) -> None:
    """Poses without places: a value above each name."""
    names = list(plane.places)
    axes.plot([names.index(pose) for pose in known], [panel.values[pose] for pose in known], "o", color="black")
    shown = list(range(0, len(names), max(1, -(-len(names) // 8))))
    axes.set_xticks(shown, [names[k] for k in shown], rotation=60 if len(names) > 3 else 0)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.ticklabel_format(axis="y", useOffset=False)


def _digits(values: Sequence[float]) -> int:
    """Decimals that tell the values apart, three digits of the largest at least."""
    largest = max((abs(value) for value in values), default=1.0)
    return int(np.clip(2 - np.floor(np.log10(largest)) if largest > 0 else 2, 0, 4))
