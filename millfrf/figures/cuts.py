"""Figures of cuts: stability lobes, islands of instability, and spectra of recorded cuts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from millfrf.stability import ChatterVerdict, CutSpectrum, KeptCut, StabilityLobes

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

MOST_NAMED = 5  # tones with a name in a panel, strongest first


@dataclass(frozen=True)
class ShownCut:
    """One panel of the figure: a cut with its verdict, and the spectrum from which the verdict was determined."""

    title: str
    quantity: str  # of the channel with its unit, for the axis
    verdict: ChatterVerdict
    spectrum: CutSpectrum

    @classmethod
    def of(cls, kept: KeptCut) -> "ShownCut":
        """Return the panel of a judged cut."""
        verdict = kept.cut.verdict
        title = f"{kept.cut.name}, {kept.cut.rpm:.0f} rpm: {verdict.in_words}"
        quantity = f"{kept.channel}, rms ({kept.unit.replace('^2', '²')})"
        return cls(title, quantity, verdict, kept.spectrum)


def chatter_figure(cuts: Sequence[ShownCut]) -> Figure:
    """Draw one panel per cut: spindle orders in grey, other motion in blue, noise floor in black, names at lines."""
    with house_style():
        figure = new_figure(12.0 + 62.0 * len(cuts))
        panels = np.atleast_1d(figure.subplots(len(cuts), 1))
        for number, (axes, cut) in enumerate(zip(panels, cuts, strict=True)):
            draw_cut_spectrum(axes, cut)
            panel_letter(axes, number)
        panels[-1].set_xlabel("Frequency (Hz)")
        legend_above(figure, panels[0], columns=3)
    return figure


def draw_cut_spectrum(axes: Axes, cut: ShownCut) -> None:
    """Draw the spectrum of a cut: spindle orders, other motion, noise floor, and names at lines."""
    spectrum = cut.spectrum
    known = np.concatenate(
        [spectrum.amplitude[np.isfinite(spectrum.amplitude)], spectrum.floor[np.isfinite(spectrum.floor)]]
    )
    low = float(known[known > 0].min()) * 10**-0.5  # half a decade below the floor
    high = float(max(known.max(), spectrum.order_amplitudes.max(initial=0.0)))
    axes.set_yscale("log")
    axes.vlines(
        spectrum.order_frequencies,
        low,
        np.maximum(spectrum.order_amplitudes, low),
        color="0.6",
        lw=1.6,
        label="spindle orders",
    )
    axes.plot(spectrum.frequencies, spectrum.amplitude, color=COLOURS[1], lw=0.7, label="what does not repeat")
    axes.plot(spectrum.frequencies, spectrum.floor, color="black", lw=1.2, ls=(0, (5, 1.5)), label="floor of the noise")
    named = _named(cut.verdict)
    for row, (frequency, text) in enumerate(named):
        _point_at(axes, spectrum, frequency, text, high * 3.0 ** (row % 3 + 1))
    axes.set(xlim=(0.0, float(spectrum.frequencies[-1])), ylim=(low, high * 3.0 ** (min(len(named), 3) + 1)))
    axes.set_ylabel(cut.quantity)
    axes.set_title(cut.title, loc="center")


def _named(verdict: ChatterVerdict) -> list[tuple[float, str]]:
    """Return frequency (Hz) and name of chatter and of tones from other sources, sorted by frequency."""
    named = [
        (tone.frequency, tone.name if "Hz" in tone.name else f"{tone.name}, {tone.frequency:.4g} Hz")
        for tone in sorted(verdict.foreign, key=lambda tone: -tone.share)[:MOST_NAMED]
    ]
    if math.isfinite(verdict.frequency):
        named.append((verdict.frequency, f"chatter, {verdict.frequency:.4g} Hz"))
    return sorted(named)


def _point_at(axes: Axes, spectrum: CutSpectrum, frequency: float, text: str, height: float) -> None:
    """Write the name of a spectral line, and draw a pointer from the name to the peak of the line."""
    near = np.abs(spectrum.frequencies - frequency) < 0.01 * spectrum.frequencies[-1]
    peaks = spectrum.amplitude[near & np.isfinite(spectrum.amplitude)]
    top = float(peaks.max()) if len(peaks) else height / 2
    right = frequency > 0.75 * spectrum.frequencies[-1]
    axes.annotate(
        text,
        (frequency, top),
        (frequency + (-1 if right else 1) * 0.015 * spectrum.frequencies[-1], height),
        ha="right" if right else "left",
        va="center",
        arrowprops={"arrowstyle": "-", "lw": 0.6},
        fontsize=8,
    )


@dataclass(frozen=True)
class StableAbove:
    """A range of stable depths (m) at one spindle speed, with unstable depths below it."""

    spindle_speed_rpm: float
    low: float
    high: float


def draw_stable_above(axes: Axes, ranges: Sequence[StableAbove], speeds_rpm: Sequence[float]) -> None:
    """Draw hatched white rectangles, as wide as the steps between the increasing speeds, on axes of mm over rpm."""
    grid = np.asarray(speeds_rpm, dtype=float)
    edges = np.concatenate([grid[:1], (grid[1:] + grid[:-1]) / 2, grid[-1:]])
    for number, span in enumerate(ranges):
        k = int(np.argmin(np.abs(grid - span.spindle_speed_rpm)))
        corner, width, height = (edges[k], 1e3 * span.low), edges[k + 1] - edges[k], 1e3 * (span.high - span.low)
        label = "stable above an island" if number == 0 else None
        field = Rectangle(corner, width, height, facecolor="white", edgecolor=COLOURS[3], linewidth=0.0)
        field.set(hatch="////", zorder=0.5, label=label)
        axes.add_patch(field)


LIMITS = "limits"  # id of the lines of depth limits; their number gives the colour of the next line


@dataclass(frozen=True)
class TriedCut:
    """A measured or simulated cut, with its result."""

    spindle_speed_rpm: float
    depth: float  # m
    kind: str  # stable, hopf or period-doubling


@dataclass(frozen=True)
class LobesBand:
    """Confidence interval of a depth limit over spindle speed; each array has one value for each speed."""

    spindle_speeds_rpm: NDArray[np.float64]
    low: NDArray[np.float64]  # m
    high: NDArray[np.float64]  # m


def lobes_figure(
    curves: Mapping[str, StabilityLobes],
    cuts: Sequence[TriedCut] = (),
    band: LobesBand | None = None,
    stable_above: Sequence[StableAbove] = (),
) -> Figure:
    """Draw depth limits in mm over rpm, one line for each entry; the area above the first is shaded.

    The line is interrupted where a cut is stable at all computed depths. Limits that rest on frequencies nobody
    measured are dotted, and the depths below those of the first entry are hatched. Limits that the errors of the
    structure leave uncertain are dashed.

    Parameters
    ----------
    curves
        Lobes by the name in the legend.
    cuts
        Measured or simulated cuts.
    band
        Confidence interval of the first lobes.
    stable_above
        Ranges of depth that are stable above an island of instability of the first lobes.
    """
    with house_style():
        figure = new_figure(115.0, None)
        panels: dict[str, Any] = (
            {"height_ratios": [1.9, 1.0], "gridspec_kw": {"hspace": 0.22}} if shows_chatter(curves) else {}
        )
        depth, *below = figure.subplots(2 if panels else 1, 1, sharex=True, squeeze=False, **panels)[:, 0]
        for number, (label, lobes) in enumerate(curves.items()):
            draw_limits(depth, lobes, label, number)
            for chatter in below:
                _draw_chatter(chatter, lobes, number)
        draw_tried_cuts(depth, cuts)
        if band is not None:
            shade: dict[str, Any] = {"color": COLOURS[1], "alpha": 0.3, "linewidth": 0, "label": "95 % interval"}
            depth.fill_between(band.spindle_speeds_rpm, 1e3 * band.low, 1e3 * band.high, **shade)
        top = depth_axis_top(list(curves.values()), cuts, stable_above)
        depth.set_ylim(0, top)
        if curves:
            first = next(iter(curves.values()))
            shade_unstable(depth, first, top)
            hatch_unmeasured(depth, first, top)
            draw_stable_above(depth, stable_above, first.spindle_speeds_rpm.tolist())
        depth.set_ylabel("Depth limit (mm)")
        (below[0] if below else depth).set_xlabel("Spindle speed (rpm)")
        for chatter in below:
            chatter.set_ylabel("Chatter\nfrequency (Hz)")
            panel_letter(depth, 0)
            panel_letter(chatter, 1)
        place_panels(figure, left=19.0, top=legend_height(depth) + 5.0, right=5.0)
        legend_above(figure, depth)
    return figure


def shows_chatter(curves: Mapping[str, StabilityLobes]) -> bool:
    """Return whether lobes have a panel of chatter frequencies: not if limits are known and no frequency is."""
    frequencies = any(np.isfinite(lobes.chatter_frequencies).any() for lobes in curves.values())
    return frequencies or not any(np.isfinite(lobes.depth_limits).any() for lobes in curves.values())


def limits_mm(lobes: StabilityLobes, unlimited: float = np.nan) -> NDArray[np.float64]:
    """Return the depth limits in mm; replace limits that are not finite by ``unlimited`` (mm)."""
    return np.where(np.isfinite(lobes.depth_limits), 1e3 * lobes.depth_limits, unlimited)


def draw_limits(axes: Axes, lobes: StabilityLobes, label: str, number: int) -> None:
    """Draw depth limits (mm) over speed (rpm), with a heavier line at period doublings; ``number`` sets the style.

    Limits that rest on frequencies nobody measured are thin and dotted, uncertain ones thin and dashed.
    """
    rpm = lobes.spindle_speeds_rpm
    solid, dotted, dashed = limit_lines(lobes)
    broken_only = np.isfinite(np.concatenate([dotted, dashed])).any() and not np.isfinite(solid).any()
    axes.plot(
        rpm, solid, label=None if broken_only else label, linewidth=_width(number), gid=LIMITS, **line_style(number)
    )
    for line, dashes, word in ((dotted, (1, 1.5), "not measured"), (dashed, (4, 2), "uncertain")):
        if np.isfinite(line).any():
            broken = {**line_style(number), "linestyle": (0, dashes), "linewidth": 0.8}
            axes.plot(rpm, line, label=f"{label}, {word}", **broken)
    doubled = np.array([name == "period-doubling" for name in lobes.bifurcations], dtype=bool)
    edge = np.where(doubled, solid, np.nan)
    if np.isfinite(edge).any():
        axes.plot(rpm, edge, color=COLOURS[2], linewidth=2.4, zorder=3, label=f"{label}, period doubling")


def limit_lines(lobes: StabilityLobes) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the limits (mm) of a solid line, and those not measured or uncertain with the ends of their neighbours.

    All are NaN elsewhere.
    """
    limit, unmeasured, uncertain = limits_mm(lobes), unmeasured_limits(lobes), _uncertain_limits(lobes)

    def reaching(chosen: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.where(_with_neighbours(chosen), limit, np.nan)

    return np.where(unmeasured | uncertain, np.nan, limit), reaching(unmeasured), reaching(uncertain)


def unmeasured_limits(lobes: StabilityLobes) -> NDArray[np.bool_]:
    """Return the speeds whose limit, or absence of a limit, rests on frequencies that were not measured."""
    return np.array([word == "unmeasured" for word in lobes.band], dtype=bool)


def _uncertain_limits(lobes: StabilityLobes) -> NDArray[np.bool_]:
    """Return the other speeds whose limit the errors of the structure leave uncertain."""
    return np.array([word == "uncertain" for word in lobes.model], dtype=bool) & ~unmeasured_limits(lobes)


def hatch_unmeasured(axes: Axes, lobes: StabilityLobes, top: float) -> None:
    """Hatch the depths below limits that rest on frequencies nobody measured, up to ``top`` (mm) without a limit."""
    chosen, rpm = unmeasured_limits(lobes), lobes.spindle_speeds_rpm
    if not chosen.any():
        return
    height = np.minimum(limits_mm(lobes, top), top)
    reach = _with_neighbours(chosen)
    # the dotted line of these limits has its own label
    label = None if np.isfinite(limits_mm(lobes)[chosen]).any() else "limit not measured"
    look: dict[str, Any] = {"hatch": "....", "facecolor": "none", "edgecolor": "0.6", "linewidth": 0.0, "zorder": 0.4}
    axes.fill_between(rpm, 0.0, height, where=reach, label=label, **look)


def _with_neighbours(chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the chosen speeds and those next to them, to which a line or an area of theirs reaches."""
    reach = chosen.copy()
    reach[1:] |= chosen[:-1]
    reach[:-1] |= chosen[1:]
    return reach


def _draw_chatter(axes: Axes, lobes: StabilityLobes, number: int) -> None:
    frequencies = _without_jumps(lobes.chatter_frequencies)
    axes.plot(lobes.spindle_speeds_rpm, frequencies, linewidth=_width(number), **line_style(number))


def _width(number: int) -> float:
    return 1.6 if number == 0 else 1.2


def _without_jumps(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return chatter frequencies with NaN after each jump between two lobes, so that the drawn line is interrupted."""
    broken = frequency.copy()
    broken[1:][np.abs(np.diff(frequency)) > 0.02 * np.abs(frequency[1:])] = np.nan
    return broken


def shade_unstable(axes: Axes, lobes: StabilityLobes, top: float) -> None:
    """Shade the unstable depths above the limits in grey, up to ``top`` (mm)."""
    rpm, limit = lobes.spindle_speeds_rpm, limits_mm(lobes, top)
    axes.fill_between(rpm, np.minimum(limit, top), top, color=SHADE, linewidth=0, zorder=0, label="unstable")
    if rpm.min() < rpm.max():
        axes.set_xlim(float(rpm.min()), float(rpm.max()))


_MARKS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("stable", "cut, stable", {"marker": "o", "markerfacecolor": "white"}),
    ("hopf", "cut, Hopf chatter", {"marker": "X", "markeredgecolor": "white"}),
    ("period-doubling", "cut, period doubling", {"marker": "s", "markeredgecolor": "white"}),
)


def draw_tried_cuts(axes: Axes, cuts: Sequence[TriedCut]) -> None:
    """Mark cuts on axes of mm over rpm by their result."""
    for kind, label, marks in _MARKS:
        chosen = [cut for cut in cuts if cut.kind == kind]
        if chosen:
            rpm, depths = [cut.spindle_speed_rpm for cut in chosen], [1e3 * cut.depth for cut in chosen]
            axes.plot(rpm, depths, linestyle="none", color="black", markersize=6, label=label, zorder=5, **marks)


def depth_axis_top(
    curves: Sequence[StabilityLobes], cuts: Sequence[TriedCut] = (), stable_above: Sequence[StableAbove] = ()
) -> float:
    """Return the upper end of a depth axis (mm): above nearly all limits, all cuts and all stable ranges."""
    finite = np.concatenate(
        [1e3 * lobes.depth_limits[np.isfinite(lobes.depth_limits)] for lobes in curves]
        + [np.array([1e3 * cut.depth for cut in cuts])]
    )
    highest_cut = max((1e3 * cut.depth for cut in cuts), default=0.0)
    top = 1.2 * float(max(np.percentile(finite, 97), highest_cut)) if len(finite) else 1.0
    return max([top, *(1.05e3 * span.high for span in stable_above)])


def draw_lobes(lobes: StabilityLobes, axes: Axes | None = None, *, label: str | None = None) -> Axes:
    """Draw depth limits in mm over spindle speed in rpm; cuts above the line are unstable.

    The line is interrupted where a cut is stable at all computed depths.

    Parameters
    ----------
    lobes
        Depth limits of one method.
    axes
        Axes to draw into, such as those of other lobes; None: new ones, in which the unstable side is shaded.
    label
        Name in the legend; None: the method.
    """
    with given_or_new(axes) as panel:
        n_lines = 0 if axes is None else sum(line.get_gid() == LIMITS for line in axes.lines)
        draw_limits(panel, lobes, lobes.method if label is None else label, n_lines)
        if axes is None:
            top = depth_axis_top([lobes])
            panel.set_ylim(0, top)
            shade_unstable(panel, lobes, top)
            hatch_unmeasured(panel, lobes, top)
        panel.set_xlabel("Spindle speed (rpm)")
        panel.set_ylabel("Depth limit (mm)")
        legend_beside(panel)
    return panel
