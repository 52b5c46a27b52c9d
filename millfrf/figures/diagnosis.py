"""Figures of diagnoses: held-out errors, growth with the level, joint laws, cuts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.mismatch import Behaviour, BinnedForce, CutDiagnosis, CutFit, Diagnosis, FreeFormLaw, ModeTrend

from .style import (
    COLOURS,
    LINE_STYLES,
    SHADE,
    decade_axis,
    given_or_new,
    house_style,
    legend_above,
    legend_height,
    new_figure,
    panel_letter,
    place_panels,
)

MOST = 6
"""Modes that are drawn: those that move most clearly."""

MARKS = "osD^vP"
ASIDE = 0.012
"""Distance between modes at one level, as a share of it, so that bars do not cover each other."""


def behaviour_figure(behaviour: Behaviour) -> Figure:
    """Change of natural frequency, and damping ratio, of each mode over the level, with two standard errors.

    Parameters
    ----------
    behaviour
        Behaviour at two levels at least.
    """
    chosen = sorted(behaviour.modes, key=_clearness)[-MOST:]
    modes = sorted(chosen, key=lambda one: one.frequencies[0])
    with house_style():
        figure = new_figure(75.0)
        panels = figure.subplots(1, 2)
        panels[0].axhline(0, color="#808080", linewidth=0.8)
        for number, mode in enumerate(modes):
            _draw_of_behaviour(panels, mode, number, number - (len(modes) - 1) / 2)
        panels[0].set_ylabel("Natural frequency, change (%)")
        panels[1].set_ylabel("Damping ratio (%)")
        panels[1].set_ylim(bottom=0)
        name = "Force" if behaviour.unit == "N" else "Drive"
        for number, axes in enumerate(panels):
            panel_letter(axes, number)
            axes.set_xscale("log")
            levels = modes[0].levels
            axes.set_xticks(levels, [f"{level:.3g}" for level in levels])
            axes.xaxis.set_minor_locator(NullLocator())
            axes.set_xlabel(f"{name}, root mean square ({behaviour.unit})")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(len(modes), 6))
    return figure


def _clearness(mode: ModeTrend) -> float:
    return max(abs(mode.shift) / max(mode.shift_error, 1e-12), abs(mode.gain) / max(mode.gain_error, 1e-12))


def _draw_of_behaviour(
    panels: "np.ndarray[tuple[int], np.dtype[np.object_]]", mode: ModeTrend, number: int, place: float
) -> None:
    """One mode in both panels."""
    at = np.array(mode.levels) * (1 + ASIDE * place)
    first = mode.frequencies[0]
    rows = (
        (100 * (np.array(mode.frequencies) / first - 1), 200 * np.array(mode.frequency_errors) / first),
        (100 * np.array(mode.damping), 200 * np.array(mode.damping_errors)),
    )
    axes: Axes
    for axes, (values, errors) in zip(panels, rows, strict=True):
        axes.errorbar(
            at,
            values,
            errors,
            color=COLOURS[number],
            linestyle=LINE_STYLES[number],
            marker=MARKS[number],
            markersize=4,
            markerfacecolor="white" if number % 2 else COLOURS[number],
            capsize=2,
            label=f"{first:.3g} Hz",
        )


BINS = 180
"""Number of parts of a turn of the spindle over which forces are averaged."""


def cut_turn_figure(found: CutDiagnosis) -> Figure:
    """Measured and computed force around the turn of the spindle, mean of all turns, and what is left, by channel."""
    lines = found.details.cut.spectra[0]
    channels = lines.recording.channels
    figure = new_figure(34.0 + 30.0 * 2)
    panels = figure.subplots(2, len(channels), sharex=True, squeeze=False, height_ratios=(3, 2))
    measured = _around(found, lines.measured)
    fits = (found.details.nominal, shown_fit(found))
    before, after = (_around(found, found.details.cut.predicted(0, one.hypothesis)) for one in fits)
    degrees = (np.arange(BINS) + 0.5) * 360 / BINS
    for column, label in enumerate(channels):
        top, low = panels[0, column], panels[1, column]
        top.plot(degrees, measured[:, column], color="0.75", linewidth=2.8, label="measured")
        look = {"color": COLOURS[2], "linestyle": (0, (4, 1.5))}
        top.plot(degrees, before[:, column], label="computed, cutting file", **look)
        low.plot(degrees, measured[:, column] - before[:, column], **look)
        top.plot(degrees, after[:, column], color=COLOURS[1], label="computed, improved")
        low.plot(degrees, measured[:, column] - after[:, column], color=COLOURS[1])
        top.set_title(label)
        low.set_xlabel("Angle of tooth 0 (deg)")
        low.set_xticks([0, 90, 180, 270, 360])
        low.set_xlim(0, 360)
    panels[0, 0].set_ylabel("Force (N)")
    panels[1, 0].set_ylabel("Difference (N)")
    figure.align_ylabels(panels[:, 0])
    legend_above(figure, panels[0, 0])
    return figure


def cut_orders_figure(found: CutDiagnosis) -> Figure:
    """Error of the computed force by spindle order, all channels and blocks together, before and after, over noise."""
    lines, noise = found.details.cut.spectra[0], found.details.cut.noise[0]
    law = found.details.nominal.hypothesis.laws[0]
    orders = lines.frequencies / (law.speed / (2 * np.pi))
    figure = new_figure(62.0)
    axes: Axes = figure.subplots()
    scale = 2 / np.sqrt(lines.size)  # a sine's amplitude
    _draw_of_cut(
        axes, orders, scale * _size(lines.measured), {"color": "0.75", "linewidth": 2.0, "label": "measured force"}
    )
    look = {"color": COLOURS[2], "linestyle": (0, (4, 1.0)), "linewidth": 0.9, "label": "left, cutting file"}
    _draw_of_cut(axes, orders, scale * _size(_rest(found, found.details.nominal)), look)
    look = {"color": COLOURS[1], "linewidth": 0.9, "label": "left, improved"}
    _draw_of_cut(axes, orders, scale * _size(_rest(found, shown_fit(found))), look)
    floor = scale * np.sqrt(noise.floor.sum(axis=1))
    _draw_of_cut(axes, orders, floor, {"color": "k", "linestyle": (0, (1, 1.2)), "label": "noise"})
    axes.set_xlim(0, orders[-1])
    axes.set_xlabel("Spindle order (frequency / spindle frequency)")
    axes.set_ylabel("Amplitude, all channels (N)")
    legend_above(figure, axes)
    return figure


def shown_fit(found: CutDiagnosis) -> CutFit:
    """Give the fit that the improved cutting file stands for."""
    return found.details.final


def _draw_of_cut(axes: Axes, orders: Real, values: Real, look: dict[str, object]) -> None:
    axes.semilogy(orders, values, **look)


def _rest(found: CutDiagnosis, fitted: CutFit) -> Complex:
    return np.asarray(found.details.cut.spectra[0].measured - found.details.cut.predicted(0, fitted.hypothesis))


def _size(lines: Complex) -> Real:
    return np.asarray(np.sqrt(np.mean(np.sum(np.abs(lines) ** 2, axis=2), axis=0)))


def _around(found: CutDiagnosis, shown: Complex) -> Real:
    """Mean over all turns of forces that hold the compared lines alone, (BINS, n_axes), N.

    Lines are windowed: the first and last eighth of each block, where the window falls, are left out.
    """
    lines, law = found.details.cut.spectra[0], shown_fit(found).hypothesis.laws[0]
    spectrum = np.zeros((lines.blocks, lines.size // 2 + 1, shown.shape[2]), dtype=complex)
    spectrum[:, lines.band] = shown
    signals = scipy.fft.irfft(spectrum, n=lines.size, axis=1) * np.sqrt(lines.size * 0.9375)
    times = (lines.first + np.arange(lines.size * lines.blocks)) / lines.recording.rate
    angles = law.angles(times).reshape(lines.blocks, lines.size)
    kept = slice(lines.size // 8, -(lines.size // 8))
    bins = (np.mod(angles[:, kept], 2 * np.pi) / (2 * np.pi) * BINS).astype(int).ravel() % BINS
    count = np.maximum(np.bincount(bins, minlength=BINS), 1)
    columns = [np.bincount(bins, signals[:, kept, c].ravel(), BINS) / count for c in range(shown.shape[2])]
    return np.stack(columns, axis=-1)


def draw_diagnosis(found: Diagnosis[object], axes: Axes | None = None) -> Axes:
    """Bars of the error on held-out data: nominal, refitted and improved; a dashed line marks the noise.

    Parameters
    ----------
    found
        Diagnosis of a structure, a robot or a cut.
    axes
        Axes to draw into; None: new ones.
    """
    gain = found.improvement
    values = [100 * value for value in (gain.before, gain.refitted, gain.after)]
    with given_or_new(axes, 62.0) as shown:
        names = ["nominal", "refitted", "improved"]
        bars = shown.barh(names, values, color=[SHADE, SHADE, COLOURS[1]], edgecolor="black", linewidth=0.6)
        shown.bar_label(
            bars, [f"{value:.3g} %" for value in values], padding=3, fontsize=shown.yaxis.label.get_fontsize()
        )
        noise = 100 * gain.noise_floor
        shown.axvline(noise, color="black", linestyle=(0, (5, 1.5)), linewidth=1.1, label=f"noise, {noise:.3g} %")
        shown.invert_yaxis()
        shown.set_xlim(0, 1.2 * max(*values, noise))
        shown.set_xlabel(f"Error on {gain.where}, share of the root mean square response (%)")
        shown.set_title(f"Verdict: {found.verdict}")
        size = shown.xaxis.label.get_fontsize()
        shown.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=size)
    return shown


LABELS = {"residual": "Nominal model, refitted", "effect": "Final model without its joint law"}
LEAST_GAP = 0.06
"""Between two labels of forces, as a share of the axis."""
REFERENCES = ((0, "dry friction"), (1, "linear"), (3, "cubic"))


def growth_figure(content: Mapping[str, Any]) -> Figure:
    """Residual above noise over force, with the slopes of typical omissions through the middle point.

    Parameters
    ----------
    content
        ``growth`` of a diagnosis' ``located``.
    """
    with house_style():
        figure = new_figure(95.0, None)
        axes = figure.subplots()
        shown = [key for key in LABELS if key in content]
        for number, key in enumerate(shown):
            _draw_of_growth(axes, LABELS[key], content[key], number)
        found = content[shown[0]]
        forces, noise = _forces(found), 100 * np.array(found["noise"])
        axes.plot(forces, noise, color="#777777", linestyle=":", marker="_", label="Noise")
        low, high = _references(axes, found)
        tops = [100 * np.max(np.add(content[key]["amplitude"], content[key]["standard_error"])) for key in shown]
        decade_axis(axes, "y", min(low, 0.3 * noise.min()), max(high, 1.5 * max(tops)), label=_plain)
        _force_axis(axes, forces)
        unit = found.get("drive_unit", "N")
        axes.set_xlabel(f"{'Force' if unit == 'N' else 'Drive'}, root mean square ({unit})")
        axes.set_ylabel("Residual less noise / response,\nroot mean square (%)")
        place_panels(figure, left=20.0, top=legend_height(axes, 1))
        legend_above(figure, axes, columns=1)
    return figure


def _forces(found: Mapping[str, Any]) -> NDArray[np.float64]:
    """Levels of what drives the rig, in newtons or in the unit that the file names."""
    return np.array(found["drive_rms"] if "drive_rms" in found else found["force_rms_n"], dtype=float)


def _plain(power: int) -> str:
    return f"{10.0**power:g}"


def _draw_of_growth(axes: Axes, label: str, found: Mapping[str, Any], number: int) -> None:
    force, amplitude, error = _forces(found), *(np.array(found[key]) for key in ("amplitude", "standard_error"))
    seen = amplitude > 0
    if found["exponent"] is not None:
        label += f": exponent {round(found['exponent'], 2) + 0.0:.2f} ± {found['exponent_standard_error']:.2f}"
    axes.errorbar(
        force[seen],
        100 * amplitude[seen],
        yerr=200 * error[seen],
        color=COLOURS[2 * number],
        marker="os"[number],
        markersize=4.5,
        linestyle="-" if number == 0 else (0, (5, 1.5)),
        capsize=2,
        label=label,
    )


def _references(axes: Axes, found: Mapping[str, Any]) -> tuple[float, float]:
    """Thin lines of the slopes 0, 1 and 3 through the point in the middle; the range that shows them, in percent."""
    force, amplitude = _forces(found), 100 * np.array(found["amplitude"])
    seen = amplitude > 0
    if not seen.any():
        return np.inf, 0.0
    x0, y0 = (float(np.exp(np.log(values[seen]).mean())) for values in (force, amplitude))
    ends = np.array([0.8 * force.min(), 1.12 * force.max()])
    for slope, name in REFERENCES:
        line = y0 * (ends / x0) ** slope
        axes.plot(ends, line, color="#aaaaaa", linewidth=0.7, zorder=1)
        axes.annotate(
            f"{name}, {slope}",
            (ends[0], line[0]),
            xytext=(-3, 0),
            textcoords="offset points",
            va="center",
            ha="right",
            color="#555555",
        )
    return 0.7 * float(amplitude[seen].min()), 1.5 * y0


def _force_axis(axes: Axes, forces: NDArray[np.float64]) -> None:
    """The force of each recording as a tick; labels that would touch are left out."""
    ends = (0.55 * forces.min(), 1.2 * forces.max())
    axes.set_xscale("log")
    axes.set_xlim(ends)
    labels, last = [], -np.inf
    for force in np.sort(forces):
        place = np.log(force / ends[0]) / np.log(ends[1] / ends[0])
        labels.append(f"{force:.3g}" if place - last > LEAST_GAP else "")
        last = place if labels[-1] else last
    axes.set_xticks(np.sort(forces), labels)
    axes.xaxis.set_minor_locator(NullLocator())


COLUMNS = 3
"""Columns of the legend, whose labels are long."""


def law_figure(found: FreeFormLaw) -> Figure:
    """Force against deflection, moving forth and back, and against velocity with what depends on deflection taken off.

    Symbols are means in bins with bands of two standard errors; lines are the accepted law driven by the same motion
    and averaged alike. Where the accepted law has a free form, dotted lines are the library's.
    """
    law = found.name.replace("_", " ")
    freed = found.forward.textbook is not None
    rising, falling = (law.capitalize(), "Free form") if freed else (f"Law ({law})", "Law")
    with house_style():
        figure = new_figure(82.0, None)
        left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.24})
        _draw_of_law(
            left, found.forward, ("o", COLOURS[0]), "Measured, deflection rising", (f"{rising}, rising", "-"), 1e6
        )
        lines = f"{falling}, falling", (0, (5, 1.5))
        _draw_of_law(left, found.backward, ("v", COLOURS[2]), "Measured, falling", lines, 1e6)
        _draw_of_law(right, found.damping, ("o", COLOURS[0]), "", ("", "-"), 1e3)
        left.set_xlabel(f"Deflection along the joint (µ{found.deflection_unit})")
        right.set_xlabel(f"Velocity along the joint (m{found.deflection_unit}/s)")
        left.set_ylabel(f"Force beyond the linear model ({found.force_unit})")
        right.set_ylabel(f"Force less its mean at that deflection ({found.force_unit})")
        _same_scale(left, right, (found.forward, found.backward, found.damping))
        for number, axes in enumerate((left, right)):
            axes.axhline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.axvline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.locator_params(axis="x", nbins=6)
            panel_letter(axes, number)
        place_panels(figure, left=17.0, top=legend_height(left, COLUMNS) + 5.0)
        legend_above(figure, left, COLUMNS)
    return figure


def _draw_of_law(
    axes: Axes,
    bins: BinnedForce,
    marks: tuple[str, str],
    label: str,
    law: tuple[str, str | tuple[int, tuple[float, ...]]],
    scale: float,
) -> None:
    at = scale * bins.at
    axes.fill_between(at, bins.force - 2 * bins.error, bins.force + 2 * bins.error, color=SHADE, linewidth=0, zorder=1)
    axes.plot(at, bins.law, color=marks[1], linestyle=law[1], linewidth=1.0, label=law[0] or None)
    if bins.textbook is not None:
        axes.plot(at, bins.textbook, color=marks[1], linestyle=":", linewidth=1.2, label=law[0] and "Textbook law")
    filled = "white" if marks[0] == "o" else marks[1]
    axes.plot(
        at, bins.force, marks[0], color=marks[1], markerfacecolor=filled, markersize=3.8, label=label or None, zorder=3
    )


def _same_scale(left: Axes, right: Axes, all_bins: tuple[BinnedForce, ...]) -> None:
    values: NDArray[np.float64] = np.concatenate(
        [np.maximum(np.abs(one.force) + 2 * one.error, np.abs(one.law)) for one in all_bins]
    )
    top = 1.1 * float(np.max(values))
    left.set_ylim(-top, top)
    right.set_ylim(-top, top)
