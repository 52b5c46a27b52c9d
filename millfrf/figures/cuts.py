"""Figures of cuts: stability lobes, islands, and spectra of judged cuts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from millfrf.stability import ChatterVerdict, CutSpectrum, StabilityLobes

from .style import (
    COLOURS,
    SHADE,
    given_or_new,
    house_style,
    legend_above,
    legend_beside,
    legend_height,
    line_style,
    new_figure,
    panel_letter,
    place_panels,
)

EACH_MM = 62.0
_DECADES = 0.5  # below the floor that are drawn


@dataclass(frozen=True)
class ShownCut:
    """One panel of the figure: a cut with its spectrum.

    Parameters
    ----------
    title
        Text above the panel.
    quantity
        Quantity of the channel with its unit, for the axis.
    verdict, spectrum
        Verdict on the cut, and the spectrum it was found from.
    """

    title: str
    quantity: str
    verdict: ChatterVerdict
    spectrum: CutSpectrum


def chatter_figure(cuts: Sequence[ShownCut]) -> Figure:
    """One panel a cut: orders as grey lines, the rest in blue, its floor in black, arrows at named lines."""
    with house_style():
        figure = new_figure(12.0 + EACH_MM * len(cuts))
        panels = np.atleast_1d(figure.subplots(len(cuts), 1))
        for number, (axes, cut) in enumerate(zip(panels, cuts, strict=True)):
            _draw(axes, cut)
            panel_letter(axes, number)
        panels[-1].set_xlabel("Frequency (Hz)")
        legend_above(figure, panels[0], columns=3)
    return figure


def _draw(axes: Axes, cut: ShownCut) -> None:
    seen = cut.spectrum
    known = np.concatenate([seen.amplitude[np.isfinite(seen.amplitude)], seen.floor[np.isfinite(seen.floor)]])
    low = float(known[known > 0].min()) * 10**-_DECADES
    high = float(max(known.max(), seen.order_amplitudes.max(initial=0.0)))
    axes.set_yscale("log")
    axes.vlines(
        seen.order_frequencies, low, np.maximum(seen.order_amplitudes, low), color="0.6", lw=1.6, label="spindle orders"
    )
    axes.plot(seen.frequencies, seen.amplitude, color=COLOURS[1], lw=0.7, label="what does not repeat")
    axes.plot(seen.frequencies, seen.floor, color="black", lw=1.2, ls=(0, (5, 1.5)), label="floor of the noise")
    named = _named(cut.verdict)
    for row, (frequency, text) in enumerate(named):
        _point_at(axes, seen, frequency, text, high * 3.0 ** (row % 3 + 1))
    axes.set(xlim=(0.0, float(seen.frequencies[-1])), ylim=(low, high * 3.0 ** (min(len(named), 3) + 1)))
    axes.set_ylabel(cut.quantity)
    axes.set_title(cut.title, loc="center")


def _named(verdict: ChatterVerdict) -> list[tuple[float, str]]:
    """Frequency (Hz) and name of the lines that are told, in order of frequency."""
    named = [
        (tone.frequency, tone.name if "Hz" in tone.name else f"{tone.name}, {tone.frequency:.4g} Hz")
        for tone in verdict.foreign
    ]
    if math.isfinite(verdict.frequency):
        named.append((verdict.frequency, f"chatter, {verdict.frequency:.4g} Hz"))
    return sorted(named)


def _point_at(axes: Axes, seen: CutSpectrum, frequency: float, text: str, height: float) -> None:
    """An arrow from a name to its line."""
    near = np.abs(seen.frequencies - frequency) < 0.01 * seen.frequencies[-1]
    found = seen.amplitude[near & np.isfinite(seen.amplitude)]
    top = float(found.max()) if len(found) else height / 2
    right = frequency > 0.75 * seen.frequencies[-1]
    axes.annotate(
        text,
        (frequency, top),
        (frequency + (-1 if right else 1) * 0.015 * seen.frequencies[-1], height),
        ha="right" if right else "left",
        va="center",
        arrowprops={"arrowstyle": "-", "lw": 0.6},
        fontsize=8,
    )


@dataclass(frozen=True)
class StableAbove:
    """A range of depths at one speed that is stable, with unstable depths beneath it.

    Parameters
    ----------
    spindle_speed_rpm : rpm
        Spindle speed at which that was found.
    low, high : m
        Lower and upper end of the range.
    """

    spindle_speed_rpm: float
    low: float
    high: float


def draw_stable_above(axes: Axes, ranges: Sequence[StableAbove], speeds_rpm: Sequence[float]) -> None:
    """White fields with a hatch, as wide as the steps between the speeds that were looked at.

    Parameters
    ----------
    axes
        Axes of depth (mm) over speed (rpm), the unstable side shaded.
    ranges
        Ranges that are stable.
    speeds_rpm
        All speeds that were looked at, increasing.
    """
    grid = np.asarray(speeds_rpm, dtype=float)
    edges = np.concatenate([grid[:1], (grid[1:] + grid[:-1]) / 2, grid[-1:]])
    for number, one in enumerate(ranges):
        k = int(np.argmin(np.abs(grid - one.spindle_speed_rpm)))
        corner, width, height = (edges[k], 1e3 * one.low), edges[k + 1] - edges[k], 1e3 * (one.high - one.low)
        label = "stable above an island" if number == 0 else None
        field = Rectangle(corner, width, height, facecolor="white", edgecolor=COLOURS[3], linewidth=0.0)
        field.set(hatch="////", zorder=0.5, label=label)
        axes.add_patch(field)


LIMITS = "limits"
"""Mark of the lines of depth limits, by which a further line finds its number and so its own colour."""


@dataclass(frozen=True)
class TriedCut:
    """A cut that was made, or simulated, and what was seen.

    Parameters
    ----------
    spindle_speed_rpm, depth
        rpm and m.
    kind
        ``stable``, ``hopf`` or ``period-doubling``.
    """

    spindle_speed_rpm: float
    depth: float
    kind: str


@dataclass(frozen=True)
class LobesBand:
    """Confidence interval of a depth limit over spindle speed.

    Parameters
    ----------
    spindle_speeds_rpm : (n_speeds,), rpm
        Spindle speeds of the limits.
    low, high : (n_speeds,), m
        Lower and upper end of the interval.
    """

    spindle_speeds_rpm: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def lobes_figure(
    curves: Mapping[str, StabilityLobes],
    cuts: Sequence[TriedCut] = (),
    band: LobesBand | None = None,
    stable_above: Sequence[StableAbove] = (),
) -> Figure:
    """Depth limits in mm over rpm, one line for each entry; the area above the first is shaded.

    Where a cut is stable at all depths asked for, the line is interrupted.

    Parameters
    ----------
    curves
        Lobes by the name in the legend.
    cuts
        Cuts that were made.
    band
        Confidence interval of the first lobes.
    stable_above
        Ranges of depth that are stable above an island of instability of the first lobes.
    """
    with house_style():
        figure = new_figure(115.0, None)
        depth, chatter = figure.subplots(2, 1, sharex=True, height_ratios=[1.9, 1.0], gridspec_kw={"hspace": 0.22})
        for number, (label, lobes) in enumerate(curves.items()):
            draw_limits(depth, lobes, label, number)
            _draw_chatter(chatter, lobes, number)
        _draw_cuts(depth, cuts)
        if band is not None:
            low, high = 1e3 * band.low, 1e3 * band.high
            depth.fill_between(
                band.spindle_speeds_rpm, low, high, color=COLOURS[1], alpha=0.3, linewidth=0, label="95 % interval"
            )
        top = max([depth_axis_top(list(curves.values()), cuts), *(1.05e3 * one.high for one in stable_above)])
        depth.set_ylim(0, top)
        if curves:
            first = next(iter(curves.values()))
            shade_unstable(depth, first, top)
            draw_stable_above(depth, stable_above, first.spindle_speeds_rpm.tolist())
        depth.set_ylabel("Axial depth limit (mm)")
        chatter.set_ylabel("Chatter\nfrequency (Hz)")
        chatter.set_xlabel("Spindle speed (rpm)")
        panel_letter(depth, 0)
        panel_letter(chatter, 1)
        place_panels(figure, left=19.0, top=legend_height(depth) + 5.0, right=5.0)
        legend_above(figure, depth)
    return figure


def draw_limits(axes: Axes, lobes: StabilityLobes, label: str, number: int) -> None:
    """Depth limits in mm over rpm, period doublings in a heavier line; ``number`` chooses colour and dashes."""
    rpm = lobes.spindle_speeds_rpm
    limit = np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, np.nan)
    axes.plot(rpm, limit, label=label, linewidth=_width(number), gid=LIMITS, **line_style(number))
    doubled = np.array([name == "period-doubling" for name in lobes.bifurcations], dtype=bool)
    if doubled.any():
        edge = np.where(doubled, limit, np.nan)
        axes.plot(rpm, edge, color=COLOURS[2], linewidth=2.4, zorder=3, label=f"{label}, period doubling")


def _draw_chatter(axes: Axes, lobes: StabilityLobes, number: int) -> None:
    frequencies = _without_jumps(lobes.chatter_frequencies)
    axes.plot(lobes.spindle_speeds_rpm, frequencies, linewidth=_width(number), **line_style(number))


def _width(number: int) -> float:
    return 1.6 if number == 0 else 1.2


def _without_jumps(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Break the line where one lobe ends and the next begins at another frequency."""
    broken = frequency.copy()
    broken[1:][np.abs(np.diff(frequency)) > 0.02 * np.abs(frequency[1:])] = np.nan
    return broken


def shade_unstable(axes: Axes, lobes: StabilityLobes, top: float) -> None:
    """Grey above the limits, up to ``top`` (mm)."""
    limit = np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, top)
    rpm = lobes.spindle_speeds_rpm
    axes.fill_between(rpm, np.minimum(limit, top), top, color=SHADE, linewidth=0, zorder=0, label="unstable")
    axes.set_xlim(float(rpm.min()), float(rpm.max()))


_MARKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("stable", "cut, stable", {"marker": "o", "markerfacecolor": "white"}),
    ("hopf", "cut, Hopf chatter", {"marker": "X", "markeredgecolor": "white"}),
    ("period-doubling", "cut, period doubling", {"marker": "s", "markeredgecolor": "white"}),
)


def _draw_cuts(axes: Axes, cuts: Sequence[TriedCut]) -> None:
    for kind, label, marks in _MARKS:
        chosen = [cut for cut in cuts if cut.kind == kind]
        if chosen:
            rpm, depths = [cut.spindle_speed_rpm for cut in chosen], [1e3 * cut.depth for cut in chosen]
            axes.plot(rpm, depths, linestyle="none", color="black", markersize=6, label=label, zorder=5, **marks)


def depth_axis_top(curves: Sequence[StabilityLobes], cuts: Sequence[TriedCut] = ()) -> float:
    """Upper end of an axis of depths (mm): above nearly all limits and above every cut that was tried."""
    finite = np.concatenate(
        [1e3 * lobes.depth_limits[np.isfinite(lobes.depth_limits)] for lobes in curves]
        + [np.array([1e3 * cut.depth for cut in cuts])]
    )
    if not len(finite):
        return 1.0
    return 1.2 * float(max(np.percentile(finite, 97), max((1e3 * cut.depth for cut in cuts), default=0.0)))


def draw_lobes(lobes: StabilityLobes, axes: Axes | None = None, *, label: str | None = None) -> Axes:
    """Depth limits in mm over spindle speed in rpm; cuts above the line are unstable.

    Where a cut is stable at all depths that were asked for, the line is interrupted.

    Parameters
    ----------
    lobes
        Depth limits found by one method.
    axes
        To draw into, such as those of other lobes; None: new ones, in which the unstable side is shaded.
    label
        Name in the legend; None: the method.
    """
    with given_or_new(axes) as shown:
        before = 0 if axes is None else sum(line.get_gid() == LIMITS for line in axes.lines)
        draw_limits(shown, lobes, lobes.method if label is None else label, before)
        if axes is None:
            top = depth_axis_top([lobes])
            shown.set_ylim(0, top)
            shade_unstable(shown, lobes, top)
        shown.set_xlabel("Spindle speed (rpm)")
        shown.set_ylabel("Axial depth limit (mm)")
        legend_beside(shown)
    return shown
