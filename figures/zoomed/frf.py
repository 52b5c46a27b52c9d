"""FRFs that zoom: one entry at a time, chosen from a list, with its model and coherence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..style import FITTED, MEASURED, SHADE
from .framed import framed, hover, legend_above, shared_range
from .plot import ZoomedPlot, as_plot

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class EntryCurves:
    """One FRF to choose.

    Parameters
    ----------
    label
        Response and excitation, for the list.
    measured : (n_lines,), complex
        Measured values; not a number where there is none.
    fitted : (n_model_lines,), complex, or None
        The model's values on its own frequencies.
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
    """Magnitude, phase and, where it is known, coherence of the entry that is chosen.

    Parameters
    ----------
    entries
        FRFs to choose from; the first one is shown first. All of them have the same curves.
    frequencies, model_frequencies : Hz
        Lines of the measured values and of the model's.
    name
        Label of the magnitude with its unit, such as ``|H| (m/N)``.
    """
    from bokeh.layouts import column

    first = _columns(entries[0])
    sources = _sources(first, frequencies, model_frequencies)
    band = shared_range((float(frequencies[0]), float(frequencies[-1])))
    size = framed("", name, band, 330, y_axis_type="log")
    angle = framed("", "Phase (°)", band, 150, y_range=(-190.0, 190.0))
    if "low" in first["measured"]:
        size.varea("f", "low", "high", source=sources["measured"], fill_color=SHADE, legend_label="± 2 std. deviations")
    told = [("frequency", "@f{0.000} Hz"), ("magnitude", "@size{0.000e}"), ("phase", "@angle{0.0}°")]
    line = size.line("f", "size", source=sources["measured"], line_color=MEASURED, legend_label="measured")
    hover(size, [line], [("measured", ""), *told], "vline")
    dots = angle.scatter("f", "angle", source=sources["measured"], color=MEASURED, size=2)
    hover(angle, [dots], told, "vline")
    if "fitted" in sources:
        dashed: dict[str, Any] = {"line_color": FITTED, "line_dash": [8, 3], "line_width": 2}
        made = size.line("f", "size", source=sources["fitted"], legend_label="fitted model", **dashed)
        hover(size, [made], [("model", ""), *told])
        angle.line("f", "angle", source=sources["fitted"], **dashed)
    panels = [size, angle]
    if "coherence" in first["measured"]:
        coherence = framed("", "γ² (1)", band, 130, y_range=(0.0, 1.05))
        seen = coherence.line("f", "coherence", source=sources["measured"], line_color=MEASURED)
        hover(coherence, [seen], [told[0], ("coherence", "@coherence{0.000}")], "vline")
        panels.append(coherence)
    panels[-1].xaxis.axis_label = "Frequency (Hz)"
    panels[-1].height += 40
    legend_above(size)
    return as_plot(column(*panels, sizing_mode="stretch_width"), [(one.label, _columns(one)) for one in entries])


def _sources(first: Mapping[str, Mapping[str, Real]], frequencies: Real, model_frequencies: Real) -> dict[str, Any]:
    from bokeh.models import ColumnDataSource

    axes = {"measured": frequencies, "fitted": model_frequencies}
    return {
        name: ColumnDataSource(
            {"f": axes[name].astype("f4"), **{key: one.astype("f4") for key, one in columns.items()}}, name=name
        )
        for name, columns in first.items()
    }


def _columns(entry: EntryCurves) -> dict[str, dict[str, Real]]:
    size = np.abs(entry.measured)
    measured = {"size": size, "angle": np.angle(entry.measured, deg=True) + 0.0 * size}
    if entry.deviation is not None:
        measured["low"] = np.maximum(size - 2 * entry.deviation, 1e-3 * size)
        measured["high"] = size + 2 * entry.deviation
    if entry.coherence is not None:
        measured["coherence"] = entry.coherence
    found = {"measured": measured}
    if entry.fitted is not None:
        angle = np.angle(entry.fitted, deg=True)
        angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
        found["fitted"] = {"size": np.abs(entry.fitted), "angle": angle}
    return found
