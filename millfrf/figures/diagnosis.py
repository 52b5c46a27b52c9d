"""Figures of diagnoses: held-out errors, growth of the residual, joint laws, cuts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.mismatch import Behaviour, BinnedForce, CutDiagnosis, Diagnosis, FreeFormLaw, ModeTrend

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

MARKERS = "osD^vP"


def behaviour_figure(behaviour: Behaviour) -> Figure:
    """Draw frequency change and damping ratio of six modes over the level, with two standard errors.

    Parameters
    ----------
    behaviour
        Modal parameters at two levels or more.
    """
    significant = sorted(behaviour.modes, key=_significance)[-6:]
    modes = sorted(significant, key=lambda mode: mode.frequencies[0])
    with house_style():
        figure = new_figure(75.0)
        panels = figure.subplots(1, 2)
        panels[0].axhline(0, color="#808080", linewidth=0.8)
        for number, mode in enumerate(modes):
            _draw_trend(panels, mode, number, number - (len(modes) - 1) / 2)
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


def _significance(mode: ModeTrend) -> float:
    return max(abs(mode.shift) / max(mode.shift_error, 1e-12), abs(mode.gain) / max(mode.gain_error, 1e-12))


def _draw_trend(
    panels: "np.ndarray[tuple[int], np.dtype[np.object_]]", mode: ModeTrend, number: int, position: float
) -> None:
    """Draw one mode in both panels."""
    # marks of different modes at one level are shifted by 1.2 % of the level, so that error bars do not overlap
    x = np.array(mode.levels) * (1 + 0.012 * position)
    first = mode.frequencies[0]
    rows = (
        (100 * (np.array(mode.frequencies) / first - 1), 200 * np.array(mode.frequency_errors) / first),
        (100 * np.array(mode.damping), 200 * np.array(mode.damping_errors)),
    )
    axes: Axes
    for axes, (values, errors) in zip(panels, rows, strict=True):
        axes.errorbar(
            x,
            values,
            errors,
            color=COLOURS[number],
            linestyle=LINE_STYLES[number],
            marker=MARKERS[number],
            markersize=4,
            markerfacecolor="white" if number % 2 else COLOURS[number],
            capsize=2,
            label=f"{first:.3g} Hz",
        )


BINS = 180  # parts of a revolution over which forces are averaged


def cut_turn_figure(diagnosis: CutDiagnosis) -> Figure:
    """Draw measured and computed force, mean of all revolutions over the angle, and their difference, by channel."""
    lines = diagnosis.details.cut.spectra[0]
    channels = lines.recording.channels
    figure = new_figure(34.0 + 30.0 * 2)
    panels = figure.subplots(2, len(channels), sharex=True, squeeze=False, height_ratios=(3, 2))
    measured = _over_angle(diagnosis, lines.measured)
    cut, fits = diagnosis.details.cut, (diagnosis.details.nominal, diagnosis.details.final)
    before, after = (_over_angle(diagnosis, cut.predicted(0, fit.hypothesis)) for fit in fits)
    degrees = (np.arange(BINS) + 0.5) * 360 / BINS
    for column, label in enumerate(channels):
        top, low = panels[0, column], panels[1, column]
        top.plot(degrees, measured[:, column], color="0.75", linewidth=2.8, label="measured")
        dashed = {"color": COLOURS[2], "linestyle": (0, (4, 1.5))}
        top.plot(degrees, before[:, column], label="computed, cutting file", **dashed)
        low.plot(degrees, measured[:, column] - before[:, column], **dashed)
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


def cut_orders_figure(diagnosis: CutDiagnosis) -> Figure:
    """Draw force, residuals before and after, and noise by spindle order, all channels and blocks together."""
    lines, noise = diagnosis.details.cut.spectra[0], diagnosis.details.cut.noise[0]
    law = diagnosis.details.nominal.hypothesis.laws[0]
    orders = lines.frequencies / (law.speed / (2 * np.pi))
    figure = new_figure(62.0)
    axes: Axes = figure.subplots()
    scale = 2 / np.sqrt(lines.size)  # a sine's amplitude
    before, after = (
        scale * _size(np.asarray(lines.measured - diagnosis.details.cut.predicted(0, fit.hypothesis)))
        for fit in (diagnosis.details.nominal, diagnosis.details.final)
    )
    measured, floor = scale * _size(lines.measured), scale * np.sqrt(noise.floor.sum(axis=1))
    axes.semilogy(orders, measured, color="0.75", linewidth=2.0, label="measured force")
    dashed: dict[str, Any] = {"color": COLOURS[2], "linestyle": (0, (4, 1.0)), "linewidth": 0.9}
    axes.semilogy(orders, before, label="residual, cutting file", **dashed)
    axes.semilogy(orders, after, color=COLOURS[1], linewidth=0.9, label="residual, improved")
    axes.semilogy(orders, floor, color="k", linestyle=(0, (1, 1.2)), label="noise")
    axes.set_xlim(0, orders[-1])
    axes.set_xlabel("Spindle order (frequency / spindle frequency)")
    axes.set_ylabel("Amplitude, all channels (N)")
    legend_above(figure, axes)
    return figure


def _size(lines: Complex) -> Real:
    return np.asarray(np.sqrt(np.mean(np.sum(np.abs(lines) ** 2, axis=2), axis=0)))


def _over_angle(diagnosis: CutDiagnosis, force: Complex) -> Real:
    """Compute the mean force (N) over the angle of a revolution, from the spectral lines that were compared.

    The result has ``BINS`` rows and a column for each axis. The spectra belong to windowed blocks; the first and the
    last eighth of each block, where the window is small, are left out.
    """
    lines, law = diagnosis.details.cut.spectra[0], diagnosis.details.final.hypothesis.laws[0]
    spectrum = np.zeros((lines.blocks, lines.size // 2 + 1, force.shape[2]), dtype=complex)
    spectrum[:, lines.band] = force
    signals = scipy.fft.irfft(spectrum, n=lines.size, axis=1) * np.sqrt(lines.size * 0.9375)
    times = (lines.first + np.arange(lines.size * lines.blocks)) / lines.recording.rate
    angles = law.angles(times).reshape(lines.blocks, lines.size)
    middle = slice(lines.size // 8, -(lines.size // 8))
    bins = (np.mod(angles[:, middle], 2 * np.pi) / (2 * np.pi) * BINS).astype(int).ravel() % BINS
    count = np.maximum(np.bincount(bins, minlength=BINS), 1)
    columns = [np.bincount(bins, signals[:, middle, c].ravel(), BINS) / count for c in range(force.shape[2])]
    return np.stack(columns, axis=-1)


def draw_diagnosis(diagnosis: Diagnosis[object], axes: Axes | None = None) -> Axes:
    """Draw bars of the error on held-out data: nominal, refitted and improved; a dashed line marks the noise.

    Parameters
    ----------
    diagnosis
        Diagnosis of a structure, a robot or a cut.
    axes
        Axes to draw into; None: new ones.
    """
    gain = diagnosis.improvement
    values = [100 * value for value in (gain.before, gain.refitted, gain.after)]
    with given_or_new(axes, 62.0) as panel:
        names = ["nominal", "refitted", "improved"]
        bars = panel.barh(names, values, color=[SHADE, SHADE, COLOURS[1]], edgecolor="black", linewidth=0.6)
        panel.bar_label(
            bars, [f"{value:.3g} %" for value in values], padding=3, fontsize=panel.yaxis.label.get_fontsize()
        )
        noise = 100 * gain.noise_floor
        panel.axvline(noise, color="black", linestyle=(0, (5, 1.5)), linewidth=1.1, label=f"noise, {noise:.3g} %")
        panel.invert_yaxis()
        panel.set_xlim(0, 1.2 * max(*values, noise))
        panel.set_xlabel(f"Error on {gain.where}, share of the root mean square response (%)")
        panel.set_title(f"Verdict: {diagnosis.verdict}")
        size = panel.xaxis.label.get_fontsize()
        panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=size)
    return panel


LABELS = {"residual": "Nominal model, refitted", "effect": "Final model without its joint law"}
REFERENCES = ((0, "dry friction"), (1, "linear"), (3, "cubic"))  # exponents of typical causes


def growth_figure(content: Mapping[str, Any]) -> Figure:
    """Draw the residual above noise over force, with the slopes of typical missing effects through the middle point.

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
            _draw_growth(axes, LABELS[key], content[key], number)
        growth = content[shown[0]]
        forces, noise = _forces(growth), 100 * np.array(growth["noise"])
        axes.plot(forces, noise, color="#777777", linestyle=":", marker="_", label="Noise")
        low, high = _references(axes, growth)
        tops = [100 * np.max(np.add(content[key]["amplitude"], content[key]["standard_error"])) for key in shown]
        decade_axis(axes, "y", min(low, 0.3 * noise.min()), max(high, 1.5 * max(tops)), label=_plain)
        _force_axis(axes, forces)
        unit = growth.get("drive_unit", "N")
        axes.set_xlabel(f"{'Force' if unit == 'N' else 'Drive'}, root mean square ({unit})")
        axes.set_ylabel("Residual less noise / response,\nroot mean square (%)")
        place_panels(figure, left=20.0, top=legend_height(axes, 1))
        legend_above(figure, axes, columns=1)
    return figure


def _forces(growth: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the level of the force, or of another excitation, in newtons or in the unit that the file states."""
    return np.array(growth["drive_rms"] if "drive_rms" in growth else growth["force_rms_n"], dtype=float)


def _plain(power: int) -> str:
    return f"{10.0**power:g}"


def _draw_growth(axes: Axes, label: str, growth: Mapping[str, Any], number: int) -> None:
    force, amplitude, error = _forces(growth), *(np.array(growth[key]) for key in ("amplitude", "standard_error"))
    positive = amplitude > 0
    if growth["exponent"] is not None:
        # adding 0.0 turns -0.00 into 0.00
        label += f": exponent {round(growth['exponent'], 2) + 0.0:.2f} ± {growth['exponent_standard_error']:.2f}"
    axes.errorbar(
        force[positive],
        100 * amplitude[positive],
        yerr=200 * error[positive],
        color=COLOURS[2 * number],
        marker="os"[number],
        markersize=4.5,
        linestyle="-" if number == 0 else (0, (5, 1.5)),
        capsize=2,
        label=label,
    )


def _references(axes: Axes, growth: Mapping[str, Any]) -> tuple[float, float]:
    """Draw thin lines of slopes 0, 1 and 3 through the middle point, and return the range of the axis in percent."""
    force, amplitude = _forces(growth), 100 * np.array(growth["amplitude"])
    positive = amplitude > 0
    if not positive.any():
        return np.inf, 0.0
    x0, y0 = (float(np.exp(np.log(values[positive]).mean())) for values in (force, amplitude))
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
    return 0.7 * float(amplitude[positive].min()), 1.5 * y0


def _force_axis(axes: Axes, forces: NDArray[np.float64]) -> None:
    """Draw a tick at the force of each recording; leave out labels closer than 6 % of the axis to another label."""
    ends = (0.55 * forces.min(), 1.2 * forces.max())
    axes.set_xscale("log")
    axes.set_xlim(ends)
    labels, last = [], -np.inf
    for force in np.sort(forces):
        position = np.log(force / ends[0]) / np.log(ends[1] / ends[0])
        labels.append(f"{force:.3g}" if position - last > 0.06 else "")
        last = position if labels[-1] else last
    axes.set_xticks(np.sort(forces), labels)
    axes.xaxis.set_minor_locator(NullLocator())


def law_figure(free_form: FreeFormLaw) -> Figure:
    """Draw force over rising and falling deflection; draw force minus its mean at equal deflection over velocity.

    Symbols are means in bins with bands of two standard errors. Lines are the accepted law, computed for the
    same motion and averaged in the same way. If the accepted law has a free form, dotted lines show the named law; if
    no law has a name, there are no lines.
    """
    law = free_form.name.replace("_", " ")
    freed = free_form.forward.textbook is not None
    rising, falling = (law.capitalize(), "Free form") if freed else (f"Law ({law})", "Law")
    rows = 3 if law else 2
    with house_style():
        figure = new_figure(82.0, None)
        left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.24})
        _draw_law(
            left,
            free_form.forward,
            ("o", COLOURS[0]),
            "Measured, deflection rising",
            (law and f"{rising}, rising", "-"),
            1e6,
        )
        lines = law and f"{falling}, falling", (0, (5, 1.5))
        _draw_law(left, free_form.backward, ("v", COLOURS[2]), "Measured, falling", lines, 1e6)
        _draw_law(right, free_form.damping, ("o", COLOURS[0]), "", ("", "-"), 1e3)
        left.set_xlabel(f"Deflection along the joint (µ{free_form.deflection_unit})")
        right.set_xlabel(f"Velocity along the joint (m{free_form.deflection_unit}/s)")
        left.set_ylabel(f"Force beyond the linear model ({free_form.force_unit})")
        right.set_ylabel(f"Force less its mean at that deflection ({free_form.force_unit})")
        _same_scale(left, right, (free_form.forward, free_form.backward, free_form.damping))
        for number, axes in enumerate((left, right)):
            axes.axhline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.axvline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.locator_params(axis="x", nbins=6)
            panel_letter(axes, number)
        place_panels(figure, left=17.0, top=legend_height(left, rows) + 5.0)
        legend_above(figure, left, rows)
    return figure


def _draw_law(
    axes: Axes,
    bins: BinnedForce,
    marks: tuple[str, str],
    label: str,
    law: tuple[str, str | tuple[int, tuple[float, ...]]],
    scale: float,
) -> None:
    x = scale * bins.at
    axes.fill_between(x, bins.force - 2 * bins.error, bins.force + 2 * bins.error, color=SHADE, linewidth=0, zorder=1)
    axes.plot(x, bins.law, color=marks[1], linestyle=law[1], linewidth=1.0, label=law[0] or None)
    if bins.textbook is not None:
        axes.plot(x, bins.textbook, color=marks[1], linestyle=":", linewidth=1.2, label=law[0] and "Textbook law")
    filled = "white" if marks[0] == "o" else marks[1]
    axes.plot(
        x, bins.force, marks[0], color=marks[1], markerfacecolor=filled, markersize=3.8, label=label or None, zorder=3
    )


def _same_scale(left: Axes, right: Axes, all_bins: tuple[BinnedForce, ...]) -> None:
    values: NDArray[np.float64] = np.concatenate(
        [np.fmax(np.abs(bins.force) + 2 * bins.error, np.abs(bins.law)) for bins in all_bins]
    )
    top = 1.1 * float(np.max(values))
    left.set_ylim(-top, top)
    right.set_ylim(-top, top)
