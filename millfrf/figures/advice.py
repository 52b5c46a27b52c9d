"""Figures that lead to a decision: depth limits with the recommended cut, and a sheet of one page for the machine."""

import textwrap
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.stability import StabilityLobes

from .cuts import (
    LobesBand,
    StableAbove,
    TriedCut,
    depth_axis_top,
    draw_limits,
    draw_stable_above,
    hatch_unmeasured,
    limits_mm,
    shade_unstable,
)
from .style import COLOURS, house_style, legend_above, legend_height, new_figure, place_panels

VISIBLE = 0.01  # share of the depth axis from which an interval is wider than the line of the limits

ROW_CHARACTERS = 46  # of a row of the sheet at its largest size

MARGIN = 0.1  # share of the depth axis from which the margin below the limit is drawn

RECOMMENDED: dict[str, Any] = {
    "color": COLOURS[3],
    "marker": "*",
    "markersize": 13,
    "markeredgecolor": "white",
    "zorder": 6,
}


@dataclass(frozen=True)
class Advice:
    """Depth limits and the cut that they recommend.

    Parameters
    ----------
    lobes
        Depth limits over spindle speed.
    cut
        Recommended cut; None: none is recommended.
    drift
        Largest relative deviation of the spindle speed that the cut allows for.
    band
        Confidence interval of the limits; None: their errors are not known.
    stable_above
        Stable depths above islands of instability.
    """

    lobes: StabilityLobes
    cut: TriedCut | None = None
    drift: float = 0.0
    band: LobesBand | None = None
    stable_above: tuple[StableAbove, ...] = ()


def advice_figure(advice: Advice) -> Figure:
    """Draw depth limits (mm) over spindle speed (rpm) with the recommended cut.

    Cuts in the grey area are unstable. Hatched limits rest on frequencies that were not measured.

    Parameters
    ----------
    advice
        Limits and recommended cut.
    """
    with house_style():
        figure = new_figure(88.0, None)
        axes = figure.subplots()
        _draw_advice(axes, advice)
        place_panels(figure, left=15.0, top=legend_height(axes, 3) + 3.0, right=5.0)
        legend_above(figure, axes, 3)
    return figure


def _draw_advice(axes: Axes, advice: Advice) -> None:
    lobes, cuts = advice.lobes, [] if advice.cut is None else [advice.cut]
    draw_limits(axes, lobes, "depth limit", 0)
    top = depth_axis_top([lobes], cuts, advice.stable_above)
    if advice.band is not None:
        low, high = 1e3 * advice.band.low, 1e3 * advice.band.high
        visible = np.nan_to_num(np.minimum(high, top) - low).max(initial=0.0) > VISIBLE * top
        label = "95 % interval of the limit" if visible else None
        axes.fill_between(
            advice.band.spindle_speeds_rpm, low, high, color=COLOURS[1], alpha=0.3, linewidth=0, label=label
        )
    axes.set_ylim(0, top)
    shade_unstable(axes, lobes, top)
    hatch_unmeasured(axes, lobes, top)
    draw_stable_above(axes, advice.stable_above, lobes.spindle_speeds_rpm.tolist())
    if advice.cut is not None:
        speed, depth = advice.cut.spindle_speed_rpm, 1e3 * advice.cut.depth
        drift = advice.drift * speed
        _draw_margin(axes, lobes, speed, depth, top)
        axes.plot([speed - drift, speed + drift], [depth, depth], color=COLOURS[3], linewidth=3.0, zorder=5)
        axes.plot([speed], [depth], linestyle="none", label="recommended cut", clip_on=False, **RECOMMENDED)
        left, right = axes.get_xlim()
        axes.set_xlim(min(left, speed - drift), max(right, speed + drift))
    axes.set(xlabel="Spindle speed (rpm)", ylabel="Depth of cut (mm)")


def _draw_margin(axes: Axes, lobes: StabilityLobes, speed: float, depth: float, top: float) -> None:
    """Draw the margin from the recommended depth (mm) up to a limit at its speed (rpm), if it can be seen.

    Where no limit was found or resolved on either side of the speed there is no margin to draw.
    """
    limit = min(float(np.interp(speed, lobes.spindle_speeds_rpm, limits_mm(lobes))), top)
    if limit - depth > MARGIN * top:
        axes.vlines(
            speed,
            depth,
            limit,
            color=COLOURS[3],
            linestyle=(0, (1, 1)),
            linewidth=1.4,
            label="margin below the limit",
            zorder=5,
        )


@dataclass(frozen=True)
class SheetContent:
    """Content of the sheet of a cut.

    Parameters
    ----------
    title, made_by
        Heading, and the line at the foot.
    answer
        The recommended cut, or why none is recommended, in one sentence.
    rows
        Names and values of the cut: speed, depth, width, removal rate, limit, confidence.
    doubts
        Deductions, what was not measured, and other doubts, the most serious first; as many stand on the sheet as fit.
    advice
        Limits and recommended cut.
    more
        Number of doubts that stand in the report alone.
    """

    title: str
    made_by: str
    answer: str
    rows: tuple[tuple[str, str], ...]
    doubts: tuple[str, ...]
    advice: Advice
    more: int = 0


A4 = (210.0, 297.0)  # mm
LINE_MM = 5.2  # height of a line of text
FOOT = 288.0  # mm from the top: the last line
CHARACTERS = 104  # characters of 9 points in the width of the text


def sheet_figure(content: SheetContent) -> Figure:
    """Draw a sheet of one A4 page for the shop: answer, numbers of the cut, lobes, doubts.

    Parameters
    ----------
    content
        Texts, numbers and limits.
    """
    with house_style():
        figure = Figure(figsize=(A4[0] / 25.4, A4[1] / 25.4))
        _line(figure, 18.0, content.title, size=15, weight="bold")
        below = _wrapped(figure, 27.0, content.answer, size=11, characters=82)
        for name, value in content.rows:
            _line(figure, below + 3.0, name, size=10)
            size = min(11.0, 11.0 * ROW_CHARACTERS / len(value))
            _line(figure, below + 3.0, value, left=75.0, size=size, weight="bold")
            below += 7.0
        height = 66.0
        axes = figure.add_axes(_box(32.0, below + 22.0, 160.0, height))
        _draw_advice(axes, content.advice)
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.01), ncols=3)
        _write_doubts(figure, below + 22.0 + height + 16.0, content)
        _line(figure, FOOT, content.made_by, size=7)
    return figure


def _write_doubts(figure: Figure, below: float, content: SheetContent) -> None:
    """Write as many doubts as fit above the foot of the page, and how many more there are."""
    if not content.doubts:
        return
    _line(figure, below, "Before you cut", size=11, weight="bold")
    below, written = below + 6.0, 0
    for doubt in content.doubts:
        lines = len(textwrap.wrap(doubt, CHARACTERS)) + 1.5  # with the line on what is left out
        if below + lines * LINE_MM > FOOT - 6.0:
            break
        below, written = _wrapped(figure, below, f"•  {doubt}", size=9, characters=CHARACTERS), written + 1
    left = len(content.doubts) - written + content.more
    if left:
        _line(figure, below, f"•  {left} more in the report", size=9)


def _box(left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
    """Return a box (mm from the top left) in the coordinates of a figure."""
    return left / A4[0], 1 - (top + height) / A4[1], width / A4[0], height / A4[1]


def _line(figure: Figure, top: float, words: str, *, left: float = 18.0, size: float, weight: str = "normal") -> None:
    figure.text(left / A4[0], 1 - top / A4[1], words, fontsize=size, fontweight=weight, va="baseline", parse_math=False)


def _wrapped(figure: Figure, top: float, words: str, *, size: float, characters: int) -> float:
    """Write a paragraph and return the place (mm) of the next line."""
    lines = textwrap.wrap(words, characters, subsequent_indent="   " if words[:1] == "•" else "")
    for number, line in enumerate(lines):
        _line(figure, top + number * LINE_MM * size / 9.5, line, size=size)
    return top + len(lines) * LINE_MM * size / 9.5 + 1.5
