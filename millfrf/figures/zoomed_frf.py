"""Interactive FRFs and stability lobes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, Real
from millfrf.stability import StabilityLobes

from .cuts import LobesBand, StableAbove, depth_axis_top, limit_lines, limits_mm, shows_chatter
from .frf import SYMBOLS, FrfCurves, lines_in_band, model_axis, model_entry, phase_line, two_deviations
from .style import COLOURS, FITTED, MEASURED, SHADE
from .zoomed import ZoomedPlot, as_plot, framed, hover, legend_above, look, shared_range


@dataclass(frozen=True)
class EntryCurves:
    """Curves of one FRF that a reader can choose.

    Parameters
    ----------
    label
        Response and excitation, for the list.
    measured : (n_lines,), complex
        Measured values; NaN where the FRF is not valid.
    fitted : (n_model_lines,), complex, or None
        Values of the model at its own frequencies.
    deviation : (n_lines,), or None
        Standard deviation of the measured values.
    coherence : (n_lines,), or None
        Coherence of the response with the excitations.
    """

    label: str
    measured: Complex
    fitted: Complex | None = None
    deviation: Real | None = None
    coherence: Real | None = None


def zoomed_frfs(entries: Sequence[EntryCurves], frequencies: Real, model_frequencies: Real, name: str) -> ZoomedPlot:
    """Draw magnitude and phase of the chosen entry, and its coherence if it is known.

    Parameters
    ----------
    entries
        FRFs to choose from; the first one is shown first. All of them have the same curves.
    frequencies, model_frequencies : Hz
        Lines of the measured values and of the model's.
    name
        Label of the magnitude with its unit, such as ``|H| (m/N)``.
    """
    panels = frf_panels(entries[0], frequencies, model_frequencies, name)
    return as_plot(panels, [(entry.label, curve_columns(entry)) for entry in entries])


def frf_panels(entry: EntryCurves, frequencies: Real, model_frequencies: Real, name: str) -> Any:
    """Draw an entry as a column of bokeh's figures, whose sources have the names ``measured`` and ``fitted``.

    Parameters
    ----------
    entry, frequencies, model_frequencies, name
        As in :func:`zoomed_frfs`.
    """
    from bokeh.layouts import column  # lazy: bokeh loads slowly

    first = curve_columns(entry)
    sources = _sources(first, frequencies, model_frequencies)
    band = shared_range((float(frequencies[0]), float(frequencies[-1])))
    size = framed("", name, band, 330, y_axis_type="log")
    angle = framed("", "Phase (°)", band, 150, y_range=(-190.0, 190.0))
    if "low" in first["measured"]:
        size.varea("f", "low", "high", source=sources["measured"], fill_color=SHADE, legend_label="± 2 std. deviations")
    tips = [("frequency", "@f{0.000} Hz"), ("magnitude", "@size{0.000e}"), ("phase", "@angle{0.0}°")]
    line = size.line("f", "size", source=sources["measured"], line_color=MEASURED, legend_label="measured")
    hover(size, [line], [("measured", ""), *tips], "vline")
    dots = angle.scatter("f", "angle", source=sources["measured"], color=MEASURED, size=2)
    hover(angle, [dots], tips, "vline")
    if "fitted" in sources:
        dashed: dict[str, Any] = {"line_color": FITTED, "line_dash": [8, 3], "line_width": 2}
        model = size.line("f", "size", source=sources["fitted"], legend_label="fitted model", **dashed)
        hover(size, [model], [("model", ""), *tips])
        angle.line("f", "angle", source=sources["fitted"], **dashed)
    panels = [size, angle]
    if "coherence" in first["measured"]:
        coherence = framed("", "γ² (1)", band, 130, y_range=(0.0, 1.05))
        curve = coherence.line("f", "coherence", source=sources["measured"], line_color=MEASURED)
        hover(coherence, [curve], [tips[0], ("coherence", "@coherence{0.000}")], "vline")
        panels.append(coherence)
    panels[-1].xaxis.axis_label = "Frequency (Hz)"
    panels[-1].height += 40
    legend_above(size)
    return column(*panels, sizing_mode="stretch_width")


def _sources(first: Mapping[str, Mapping[str, Real]], frequencies: Real, model_frequencies: Real) -> dict[str, Any]:
    from bokeh.models import ColumnDataSource

    axes = {"measured": frequencies, "fitted": model_frequencies}
    return {
        name: ColumnDataSource(
            {"f": axes[name].astype("f4"), **{key: values.astype("f4") for key, values in columns.items()}}, name=name
        )
        for name, columns in first.items()
    }


def curve_columns(entry: EntryCurves) -> dict[str, dict[str, Real]]:
    """Return the columns of the sources of an entry, without frequencies."""
    size = np.abs(entry.measured)
    # adding 0 times the magnitude makes the phase NaN where the value is
    measured = {"size": size, "angle": np.angle(entry.measured, deg=True) + 0.0 * size}
    if entry.deviation is not None:
        measured["low"], measured["high"] = two_deviations(size, entry.deviation)
    if entry.coherence is not None:
        measured["coherence"] = entry.coherence
    columns = {"measured": measured}
    if entry.fitted is not None:
        columns["fitted"] = {"size": np.abs(entry.fitted), "angle": phase_line(entry.fitted)}
    return columns


def zoomed_matrix(curves: FrfCurves) -> ZoomedPlot:
    """Draw one entry of an FRF matrix at a time; :func:`millfrf.figures.frf_figures` draws them side by side.

    Parameters
    ----------
    curves
        FRF, models and bands.
    """
    frf = curves.measured
    f, values, deviation = lines_in_band(curves)
    axis = np.zeros(0) if curves.fitted is None else model_axis(curves.fitted, curves.model_band)
    entries = []
    for p, response in enumerate(frf.responses):
        for q, excitation in enumerate(frf.excitations):
            entries.append(
                EntryCurves(
                    f"{response} / {excitation}",
                    values[:, p, q],
                    _model_values(curves, axis, p, q),
                    None if deviation is None else deviation[:, p, q],
                    _coherence(frf, p, q, curves.band),
                )
            )
    return zoomed_frfs(entries, f, axis, f"|{SYMBOLS.get(frf.quantity, 'H')}| ({frf.unit})")


def _model_values(curves: FrfCurves, axis: Real, p: int, q: int) -> Complex | None:
    """Return the model's values of an entry; NaN if the model lacks it, so that all entries have equal curves."""
    if curves.fitted is None:
        return None
    entry = model_entry(curves.fitted, axis, curves.measured, p, q)
    return np.full(len(axis), np.nan + 0j) if entry is None else entry


def _coherence(frf: Frf, p: int, q: int, band: tuple[float, float]) -> Real | None:
    in_band = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    if frf.multiple_coherence is not None:
        return np.asarray(frf.multiple_coherence[in_band, p])
    return None if frf.coherence is None else np.asarray(frf.coherence[in_band, p, q])


def zoomed_limits(
    curves: Mapping[str, StabilityLobes], band: LobesBand | None = None, stable_above: Sequence[StableAbove] = ()
) -> ZoomedPlot:
    """Draw depth limits in mm over rpm, and the chatter frequency below where one is known.

    Parameters
    ----------
    curves
        Lobes by the name in the legend; the first one's unstable side is shaded.
    band
        Confidence interval of the first.
    stable_above
        Ranges of depth that are stable above an island of instability of the first.
    """
    return as_plot(limits_panels(curves, band, stable_above))


def limits_panels(
    curves: Mapping[str, StabilityLobes], band: LobesBand | None = None, stable_above: Sequence[StableAbove] = ()
) -> Any:
    """Draw depth limits as a column of bokeh's figures.

    Parameters
    ----------
    curves, band, stable_above
        As in :func:`zoomed_limits`.
    """
    from bokeh.layouts import column  # lazy: bokeh loads slowly

    first = next(iter(curves.values()))
    rpm = first.spindle_speeds_rpm
    speeds = shared_range((float(rpm.min()), float(rpm.max())), "spindle speed")
    top = depth_axis_top(list(curves.values()), stable_above=stable_above)
    words = "Spindle speed (rpm)"
    below = [framed(words, "Chatter frequency (Hz)", speeds, 200)] if shows_chatter(curves) else []
    depth = framed("" if below else words, "Depth limit (mm)", speeds, 340, y_range=(0.0, top))
    depth.varea(
        rpm, np.minimum(limits_mm(first, 1e3), 1e3), np.full(len(rpm), 1e3), fill_color=SHADE, legend_label="unstable"
    )
    if stable_above:
        _draw_ranges(depth, stable_above, rpm)
    if band is not None:
        shade: dict[str, Any] = {"fill_color": COLOURS[1], "fill_alpha": 0.3, "legend_label": "95 % interval"}
        depth.varea(band.spindle_speeds_rpm, 1e3 * band.low, 1e3 * np.minimum(band.high, 1.0), **shade)
    for number, (name, lobes) in enumerate(curves.items()):
        source = _source(lobes)
        tips = [
            (name, ""),
            ("spindle speed", "@rpm{0} rpm"),
            ("depth limit", "@depth{0.000} mm"),
            ("chatter", "@chatter{0.00} Hz, @kind"),
            ("status", "@status"),
        ]
        line = depth.line("rpm", "measured", source=source, legend_label=name, line_width=2, **look(number))
        lines = [line]
        for column_name, dash, words in (("open", "dotted", "not measured"), ("uncertain", "dashed", "uncertain")):
            if np.isfinite(source.data[column_name]).any():
                broken = {**look(number), "line_dash": dash, "legend_label": f"{name}, {words}"}
                lines.append(depth.line("rpm", column_name, source=source, line_width=1, **broken))
        hover(depth, lines, tips)
        for chatter in below:
            dots = chatter.scatter("rpm", "chatter", source=source, size=3, color=look(number)["line_color"])
            hover(chatter, [dots], tips)
    legend_above(depth)
    return column(depth, *below, sizing_mode="stretch_width")


def _draw_ranges(depth: Any, ranges: Sequence[StableAbove], rpm: NDArray[np.float64]) -> None:
    """Draw stable ranges as white rectangles as wide as the steps of speed."""
    from bokeh.models import ColumnDataSource

    columns = {
        "rpm": [span.spindle_speed_rpm for span in ranges],
        "low": [1e3 * span.low for span in ranges],
        "high": [1e3 * span.high for span in ranges],
    }
    source = ColumnDataSource(columns)
    width = float(np.median(np.diff(rpm)))
    white: dict[str, Any] = {
        "fill_color": "#ffffff",
        "line_color": COLOURS[3],
        "legend_label": "stable above an island",
    }
    bars = depth.vbar(x="rpm", width=width, bottom="low", top="high", source=source, **white)
    hover(depth, [bars], [("stable again", "@low{0.00} to @high{0.00} mm"), ("spindle speed", "@rpm{0} rpm")])


def _source(lobes: StabilityLobes) -> Any:
    from bokeh.models import ColumnDataSource

    measured, open_limits, uncertain = limit_lines(lobes)
    return ColumnDataSource(
        {
            "rpm": lobes.spindle_speeds_rpm,
            "depth": limits_mm(lobes),
            "measured": measured,
            "open": open_limits,
            "uncertain": uncertain,
            "chatter": lobes.chatter_frequencies,
            "kind": list(lobes.bifurcations),
            "status": list(lobes.status),
        }
    )
