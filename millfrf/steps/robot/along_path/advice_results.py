"""Table, picture and sentences of advice along a path."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.core import Real, counted
from millfrf.figures import COLOURS, LINE_STYLES, SHADE, house_style, new_figure, panel_letter

from ...settings import RPM
from .advice import PathAdvice, SegmentAdvice

COLUMNS = (
    "segment",
    *(f"{end}_{axis}_m" for end in ("begin", "end") for axis in "xyz"),
    "measured",
    "spindle_speed_rpm",
    "depth_m",
    "limit_low_m",
    "limit_median_m",
    "limit_high_m",
    "chatter_frequency_hz",
    "common_speed_rpm",
    "depth_at_common_speed_m",
    "remaining_variance",
    "note",
)


def advice_table(advice: PathAdvice) -> list[list[object]]:
    """Return a row for each segment; an empty depth is no advice, and ``note`` says why."""
    common = advice.common_speed()
    rows: list[list[object]] = []
    for number, entry in enumerate(advice.segments, 1):
        limits, chosen = entry.limits, advice.speed(entry)
        ends = [*entry.segment.places[0].position, *entry.segment.places[2].position]
        band = [float(ends_of_band[chosen]) for ends_of_band in (limits.low, limits.middle, limits.high)]
        rows.append(
            [
                *(number, *ends, "far" if limits.far else "yes", advice.cut.speeds[chosen] / RPM),
                *(advice.depth(entry, chosen), *band, limits.frequency[chosen]),
                *(advice.cut.speeds[common] / RPM, advice.depth(entry, common), limits.remaining_variance),
                _note(advice, entry),
            ]
        )
    return rows


def _note(advice: PathAdvice, entry: SegmentAdvice) -> str:
    depth = advice.depth(entry, advice.speed(entry))
    if entry.limits.far:
        left = 100 * entry.limits.remaining_variance
        return f"no depth: far from every measured posture ({left:.0f} % of the variance is left); measure a nearer one"
    if np.isnan(depth):
        return "no depth holds at any of the speeds"
    return "the largest depth searched" if depth >= advice.cut.max_depth else ""


def advice_sentences(advice: PathAdvice) -> list[str]:
    """Return the range of the advice, and the best speed for the whole path."""
    chosen = [(entry, advice.speed(entry)) for entry in advice.segments if not entry.limits.far]
    total = len(advice.segments)
    if not chosen:
        return [f"no advice: all of {counted(total, 'segment')} lie far from every measured posture"]
    depths = 1e3 * np.array([advice.depth(entry, speed) for entry, speed in chosen])
    speeds = np.array([advice.cut.speeds[speed] for _, speed in chosen]) / RPM
    where = f"in {len(chosen)} of {counted(total, 'segment')}"
    if np.isnan(depths).all():
        return [f"no depth holds with 97.5 % {where}, at none of the speeds"]
    common = advice.common_speed()
    least = float(np.min([entry.limits.low[common] for entry, _ in chosen]))
    return [
        f"depth {_span(depths, '.3g')} mm at {_span(speeds, '.0f')} rpm {where}: the largest removal rate that holds "
        "with 97.5 % in each",
        f"one speed for all of these: {advice.cut.speeds[common] / RPM:.0f} rpm, {1e3 * least:.3g} mm deep"
        if least > 0
        else "one speed for all of these: none of the speeds has a depth in every one",
    ]


def _span(values: Real, form: str) -> str:
    low, high = (format(end, form) for end in (np.nanmin(values), np.nanmax(values)))
    return low if low == high else f"{low} to {high}"


def advice_warnings(advice: PathAdvice) -> list[str]:
    """Return warnings of segments without advice, of limits that change inside a segment, and of turning feed."""
    lines = []
    far = [k for k, entry in enumerate(advice.segments, 1) if entry.limits.far]
    if far:
        lines.append(
            f"{len(far)} of {counted(len(advice.segments), 'segment')} (first {far[0]}) are far from every measured "
            "posture and get no depth: measure nearer postures and learn again"
        )
    turn = float(np.degrees(max(entry.segment.feed_turn for entry in advice.segments)))
    if turn >= 1:
        lines.append(
            f"the feed turns by up to {turn:.0f} deg from the directions in which limits were computed inside a "
            "segment: give more --segments"
        )
    return lines


@house_style()
def advice_figure(advice: PathAdvice) -> Figure:
    """Draw depth with its band, and speed, over the length of the path; hatched where no posture nearby is measured."""
    figure = new_figure(110.0)
    depths, speeds = figure.subplots(2, 1, sharex=True, height_ratios=(1.7, 1.0))
    way = 1e3 * np.array(
        [advice.segments[0].segment.lengths[0], *(entry.segment.lengths[1] for entry in advice.segments)]
    )
    chosen = [advice.speed(entry) for entry in advice.segments]
    low, middle, high = (
        1e3 * np.array([getattr(entry.limits, name)[k] for entry, k in zip(advice.segments, chosen, strict=True)])
        for name in ("low", "middle", "high")
    )
    advised = 1e3 * np.array([advice.depth(entry, k) for entry, k in zip(advice.segments, chosen, strict=True)])
    common = advice.common_speed()
    depths.stairs(high, way, baseline=low, fill=True, color=SHADE, label="95 % band of the limit")
    _steps(depths, way, middle, COLOURS[0], LINE_STYLES[1], "median")
    _steps(depths, way, advised, COLOURS[1], LINE_STYLES[0], "advised (97.5 %)")
    at_common = 1e3 * np.array([advice.depth(entry, common) for entry in advice.segments])
    _steps(depths, way, at_common, COLOURS[2], LINE_STYLES[2], "at one speed")
    rates = np.where(np.isnan(advised), np.nan, advice.cut.speeds[chosen] / RPM)
    _steps(speeds, way, rates, COLOURS[1], LINE_STYLES[0], "")
    one_rate = np.where(np.isnan(at_common), np.nan, advice.cut.speeds[common] / RPM)
    _steps(speeds, way, one_rate, COLOURS[2], LINE_STYLES[2], "")
    _hatch(depths, advice.segments, "far from every measured posture")
    _hatch(speeds, advice.segments, "")
    depths.set_ylabel("Depth of cut (mm)")
    depths.set_ylim(0, 1.08 * float(high.max()) or 1.0)
    speeds.set_ylabel("Spindle speed\n(rpm)")
    speeds.set_xlabel("Way along the path (mm)")
    speeds.set_xlim(way[0], way[-1])
    for number, axes in enumerate((depths, speeds)):
        panel_letter(axes, number)
    figure.legend(*depths.get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return figure


def _steps(axes: Axes, way: Real, values: Real, colour: str, line: str, label: str) -> None:
    axes.stairs(values, way, baseline=None, color=colour, linestyle=line, label=label or None)


def _hatch(axes: Axes, segments: Sequence[SegmentAdvice], label: str) -> None:
    for entry in (entry for entry in segments if entry.limits.far):
        begin, end = (1e3 * length for length in entry.segment.lengths)
        axes.axvspan(begin, end, facecolor="none", edgecolor="0.5", hatch="///", linewidth=0, label=label or None)
        label = ""
