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

LEAST_SPREAD = 1e-3  # m or rad; smallest range of a coordinate of a map


@dataclass(frozen=True)
class MapPlane:
    """Two coordinates of each pose for a map."""

    places: Mapping[str, Real]  # (2,) by name of the pose
    labels: tuple[str, str]  # of the axes, with units
    names: bool = False  # a row of names: coordinates are unknown


def tip_positions(robot: str | None, sets: Sequence[SetResults]) -> tuple[dict[str, Real], str]:
    """Return the position of the tool tip (m, base frame) by name of the set, and an error message (empty: none)."""
    if robot is None:
        return {}, ""
    try:
        case = read_robot(robot)
        if isinstance(case, PlanarCase):
            return {}, ""
        mechanism = case.robot.mechanism
        tool = mechanism.index(mechanism.tool)
        positions = {
            results.name: mechanism.transforms(close_loops(mechanism, np.array(results.measured.posture)))[tool, :3, 3]
            for results in sets
            if results.measured.posture is not None
        }
    except InputError as error:
        return {}, f"maps do not show tool positions: {error}"
    return positions, ""


def map_plane(sets: Sequence[SetResults], places: Mapping[str, Real]) -> MapPlane:
    """Choose the two coordinates of the maps: two of the tool tip, else two joint values, else a row of names.

    ``places`` contains the position x, y, z (m) of the tool tip by name of the set.
    """
    poses = sorted({results.measured.pose for results in sets})
    tips = {results.measured.pose: places[results.name] for results in sets if results.name in places}
    if len(tips) == len(poses):
        chosen = _widest(np.array([tips[pose] for pose in poses]))
        if chosen is not None:
            axis_labels = tuple(f"tool tip {'xyz'[k]} (m)" for k in chosen)
            return MapPlane({pose: tips[pose][list(chosen)] for pose in poses}, (axis_labels[0], axis_labels[1]))
    joints = {
        results.measured.pose: results.measured.posture for results in sets if results.measured.posture is not None
    }
    if len(joints) == len(poses) and len({len(results) for results in joints.values()}) == 1:
        chosen = _widest(np.array([joints[pose] for pose in poses]))
        if chosen is not None:
            values = {pose: np.array(joints[pose])[list(chosen)] for pose in poses}
            return MapPlane(values, (f"joint {chosen[0] + 1} (rad or m)", f"joint {chosen[1] + 1} (rad or m)"))
    row = {pose: np.array([float(k), 0.0]) for k, pose in enumerate(poses)}
    return MapPlane(row, ("pose", ""), names=True)


def _widest(positions: Real) -> tuple[int, int] | None:
    """Return the two coordinates with the largest range; None if none varies."""
    if positions.shape[1] < 2 or len(positions) < 2:
        return None
    spread = np.ptp(positions, axis=0)
    first, second = sorted(np.argsort(-spread, kind="stable")[:2].tolist())
    return (first, second) if spread.max() > LEAST_SPREAD else None


TREND_COLUMNS, TREND_ROW_MM = 2, 58.0
MOST_PANELS = 8  # most drifts that are drawn


def draw_trends(drifts: Sequence[Drift], all_trends: Sequence[Trend], words: Sequence[tuple[str, str]]) -> Figure:
    """Draw the first drifts, two in a row."""
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
            _trend_panel(place, shown[k].trend, all_trends)
            if len(shown) > 1:
                panel_letter(place, k)
            place.set_title(words[k][0])
            place.set_xlabel(words[k][1])
            place.set_ylabel("change from the pose's mean (%)")
    return figure


def _trend_panel(axes: Axes, trend: Trend, all_trends: Sequence[Trend]) -> None:
    series = trend.series
    for other in all_trends:
        same_quantity = (other.series.mode, other.series.quantity, other.label) == (
            series.mode,
            series.quantity,
            trend.label,
        )
        if same_quantity and other.series.pose != series.pose:
            x, y, _ = _points(other)
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
    """Return label, deviation from the mean (%) and stated standard error (%) of the sets."""
    series: Series = trend.series
    chosen = np.array([row in trend.rows for row in series.rows])
    logs = series.logs[chosen]
    order = np.argsort(trend.values, kind="stable")
    return trend.values[order], 100 * np.expm1(logs - logs.mean())[order], 100 * series.errors[chosen][order]


PANEL = (112.0, 95.0)  # points; width and height of a panel
MARK, LETTER, HEIGHT = 7.0, 3.9, 6.5  # points; sizes of a mark, width of a letter, height of a line


def free_sides(places: Real, texts: Sequence[str]) -> list[tuple[float, float] | None]:
    """Choose the offset (points) of each text from its mark; None for a text without a free side.

    Parameters
    ----------
    places : (n, 2)
        Positions of the marks, in any unit.

    Examples
    --------
    >>> free_sides(np.array([[0.0, 0.0], [1.0, 1.0]]), ["1.2", "3.4"])
    [(0.0, 7.0), (0.0, 7.0)]
    """
    span = np.ptp(places, axis=0)
    at = (places - places.min(axis=0)) / np.where(span > 0, span, 1.0) * PANEL
    boxes_taken = [(*point, MARK, MARK) for point in at]
    sides: list[tuple[float, float] | None] = []
    for number, text in enumerate(texts):
        size = (LETTER * len(text), HEIGHT)
        others = [box for k, box in enumerate(boxes_taken) if k != number]
        boxes = {side: (*(at[number] + side), *size) for side in _sides(size[0])}
        free = [side for side, own_box in boxes.items() if not any(_meet(own_box, box) for box in others)]
        sides.append(free[0] if free else None)
        if free:
            boxes_taken.append((*(at[number] + free[0]), *size))
    return sides


def _sides(width: float) -> tuple[tuple[float, float], ...]:
    """Return offsets of a text from its mark (points): above, below, right, left."""
    shift = (MARK + width) / 2 + 1.0
    return (0.0, 7.0), (0.0, -7.0), (shift, 0.0), (-shift, 0.0)


def _meet(first: Sequence[float], second: Sequence[float]) -> bool:
    """Return whether two boxes (centre, width, height) overlap."""
    return (
        abs(first[0] - second[0]) < (first[2] + second[2]) / 2
        and abs(first[1] - second[1]) < (first[3] + second[3]) / 2
    )


SHADES = "cividis"  # monotonic lightness; readable with colour blindness
MAP_COLUMNS, MAP_ROW_MM = 3, 62.0
MOST_WRITTEN = 24  # most poses with a written value


@dataclass(frozen=True)
class MapPanel:
    """One quantity over poses."""

    title: str  # quantity with unit
    values: Mapping[str, float]  # by name of the pose


def draw_maps(panels: Sequence[MapPanel], plane: MapPlane) -> Figure:
    """Draw panels in rows of three; fewer panels make a narrower picture."""
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
    with_value = [pose for pose in plane.places if np.isfinite(panel.values.get(pose, np.nan))]
    missing = [pose for pose in plane.places if pose not in with_value]
    axes.set_title(panel.title)
    if plane.names:
        _named(axes, panel, plane, with_value)
        return
    at = np.array([plane.places[pose] for pose in with_value]).reshape(-1, 2)
    values = [panel.values[pose] for pose in with_value]
    if missing:
        empty = np.array([plane.places[pose] for pose in missing])
        axes.plot(empty[:, 0], empty[:, 1], "o", markerfacecolor="none", markeredgecolor="0.5", markersize=6)
    if with_value:
        marks = axes.scatter(at[:, 0], at[:, 1], c=values, cmap=SHADES, s=42, edgecolors="black", linewidths=0.5)
        bar = figure.colorbar(marks, ax=axes, location="bottom", ticks=MaxNLocator(5), shrink=0.9, aspect=28, pad=0.02)
        bar.ax.tick_params(labelsize=7)
    if with_value and len(with_value) <= MOST_WRITTEN:
        texts = [f"{value:.{_digits(values)}f}" for value in values]
        for place, text, side in zip(at, texts, free_sides(at, texts), strict=True):
            if side is not None:
                x, y = place
                axes.annotate(text, (x, y), side, textcoords="offset points", ha="center", va="center", fontsize=6)
    axes.margins(0.14)
    axes.locator_params(nbins=5)


def _named(axes: Axes, panel: MapPanel, plane: MapPlane, with_value: Sequence[str]) -> None:
    """Draw values over a row of names."""
    names = list(plane.places)
    axes.plot(
        [names.index(pose) for pose in with_value], [panel.values[pose] for pose in with_value], "o", color="black"
    )
    shown = list(range(0, len(names), max(1, -(-len(names) // 8))))
    axes.set_xticks(shown, [names[k] for k in shown], rotation=60 if len(names) > 3 else 0)
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.ticklabel_format(axis="y", useOffset=False)


def _digits(values: Sequence[float]) -> int:
    """Return the number of decimals for three digits of the largest value."""
    largest = max((abs(value) for value in values), default=1.0)
    return int(np.clip(2 - np.floor(np.log10(largest)) if largest > 0 else 2, 0, 4))
