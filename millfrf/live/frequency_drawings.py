"""Figures of the live page over frequency, and the list of all its figures."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel
from estimation import Frf
from millfrf.figures import COLOURS

from .control import Mark
from .drawings import GREEN, RED, Choice, Content, Drawing, framed, levels, number, plain, thinned, traces, unit_text
from .monitor import LiveMonitor, Snapshot
from .spectra import BandProgress

FREQUENCY = "Frequency (Hz)"
_HARMONICS = 3  # of the tooth-passing frequency
_TINY = 1e-30  # smallest density on the logarithmic axis
_COLOUR = COLOURS[1]

Kind = Literal["magnitude", "phase", "coherence"]


def spectrum(channels: Sequence[Channel], band: tuple[float, float]) -> Drawing:
    """Draw amplitude densities of chosen channels, and the tooth-passing frequency with harmonics."""
    from bokeh.models import ColumnDataSource

    plot = framed(
        "spectra", "Spectra", FREQUENCY, "Amplitude density (unit/√Hz)", y_axis_type="log", x_range=(0, band[1])
    )
    data = ColumnDataSource({"xs": [], "ys": [], "colour": [], "name": []}, name="spectra.data")
    plot.multi_line("xs", "ys", color="colour", legend_field="name", source=data)
    plot.add_layout(plot.legend[0], "right")
    teeth = ColumnDataSource({"x": []}, name="teeth")
    plot.vspan(x="x", source=teeth, line_dash="dashed", line_color="#999999")
    labels = [f"{plain(channel.name)} ({unit_text(channel.unit)})" for channel in channels]

    def content(shown: Snapshot, choice: Choice, _: Sequence[Mark]) -> Content:
        passing, spectra = shown.tooth_passing, shown.spectra
        title = (
            f"Spectra of this test; dashed: tooth passing {number(passing)} Hz" if passing else "Spectra of this test"
        )
        xs: list[Any] = []
        ys: list[Any] = []
        if spectra is not None:
            step = thinned(len(spectra.power))
            density = np.maximum(np.sqrt(spectra.power[step]), _TINY)
            xs, ys = [spectra.frequencies[step]] * len(choice.spectra), [density[:, k] for k in choice.spectra]
        drawn = choice.spectra if xs else ()
        lines = {
            "xs": xs,
            "ys": ys,
            "colour": [COLOURS[k % len(COLOURS)] for k in range(len(drawn))],
            "name": [labels[k] for k in drawn],
        }
        harmonics = {"x": [order * passing for order in range(1, _HARMONICS + 1)] if passing else []}
        return {"sources": {"spectra.data": lines, "teeth": harmonics}, "title": title}

    return Drawing("spectra", plot, content)


def transfer(
    kind: Kind, responses: Sequence[Channel], excitations: Sequence[Channel], band: tuple[float, float]
) -> Drawing:
    """Draw an FRF entry (magnitude with two standard deviations, or phase), or the multiple coherence."""
    from bokeh.models import ColumnDataSource, FixedTicker

    label = {"magnitude": "Magnitude", "phase": "Phase (°)", "coherence": "Multiple coherence"}[kind]
    scale = "log" if kind == "magnitude" else "linear"
    plot = framed(kind, label, FREQUENCY, label, y_axis_type=scale, x_range=(0, band[1]))
    data = ColumnDataSource({"x": [], "y": []}, name=f"{kind}.data")
    if kind == "magnitude":
        errors = ColumnDataSource({"xs": [], "ys": []}, name="errors")
        plot.patches("xs", "ys", source=errors, fill_alpha=0.25, fill_color=_COLOUR, line_color=None)
    line = plot.line("x", "y", source=data, color=_COLOUR)
    if kind == "magnitude":
        plot.y_range.renderers = [line]  # a wide error band must not flatten the curve
    elif kind == "phase":
        plot.y_range.start, plot.y_range.end = -190.0, 190.0
        plot.yaxis.ticker = FixedTicker(ticks=[-180, -90, 0, 90, 180])
    else:
        plot.y_range.start, plot.y_range.end = 0.0, 1.05

    def content(shown: Snapshot, choice: Choice, _: Sequence[Mark]) -> Content:
        response, excitation = plain(responses[choice.response].name), plain(excitations[choice.excitation].name)
        title = {
            "magnitude": f"FRF {response} / {excitation}",
            "phase": f"Phase of the FRF {response} / {excitation}",
            "coherence": f"Multiple coherence of {response}",
        }[kind]
        frf = shown.frf
        if frf is None:
            title = f"{title}: {shown.why_no_frf}"
            empty: dict[str, Any] = {f"{kind}.data": {"x": [], "y": []}}
            return {
                "sources": empty | ({"errors": {"xs": [], "ys": []}} if kind == "magnitude" else {}),
                "title": title,
            }
        sources, axis = _curve(frf, shown.known, kind, choice.response, choice.excitation), {}
        if not len(sources[f"{kind}.data"]["x"]):
            title += ": no significant line yet"
        elif kind == "magnitude":
            title += "; band: two standard deviations"
        if kind == "magnitude":
            axis = {"y_label": f"Magnitude ({unit_text(frf.unit)})"}
        return {"sources": sources, "title": title, **axis}

    return Drawing(kind, plot, content)


def _curve(frf: Frf, known: NDArray[np.bool_], kind: Kind, response: int, excitation: int) -> dict[str, Any]:
    """Return the measured lines of an entry, with NaN where lines are missing, so that gaps stay visible."""
    deviation = _deviation(frf, response, excitation)
    significant = np.abs(frf.values[:, response, excitation]) > 2 * deviation  # the other lines are noise
    chosen = np.flatnonzero(known if kind == "coherence" else known & significant)
    step = thinned(len(chosen)).step
    chosen = chosen[::step]
    f, entry = frf.frequencies[chosen], frf.values[chosen, response, excitation]
    breaks = np.diff(chosen) > 1.5 * step
    if kind == "phase":
        value = np.degrees(np.angle(entry))
        breaks = breaks | (np.abs(np.diff(value)) > 180)  # no line from -180 to 180
    elif kind == "coherence":
        value = np.zeros(len(f)) if frf.multiple_coherence is None else frf.multiple_coherence[chosen, response]
    else:
        value = np.abs(entry)
    gaps = np.flatnonzero(breaks) + 1
    sources: dict[str, Any] = {f"{kind}.data": {"x": np.insert(f, gaps, np.nan), "y": np.insert(value, gaps, np.nan)}}
    if kind == "magnitude":
        error = 2 * deviation[chosen]
        runs = [run for run in np.split(np.arange(len(f)), gaps) if len(run) > 1]
        low, high = np.maximum(value - error, 1e-3 * value), value + error
        xs = [np.concatenate([f[run], f[run][::-1]]) for run in runs]
        sources["errors"] = {"xs": xs, "ys": [np.concatenate([low[run], high[run][::-1]]) for run in runs]}
    return sources


def _deviation(frf: Frf, response: int, excitation: int) -> NDArray[np.float64]:
    if frf.covariance is None:
        return np.zeros(len(frf.frequencies))
    return np.asarray(np.sqrt(frf.covariance.variance()[:, response, excitation]))


def enough(band: tuple[float, float]) -> Drawing:
    """Draw for each band the number of averages so far over the number needed for the planned error of the FRF."""
    from bokeh.models import ColumnDataSource

    title = "Enough data? Green: yes"
    needed = "Share of the averages that the planned error needs"
    plot = framed("enough", title, needed, FREQUENCY, y_range=band)
    plot.x_range.start, plot.x_range.end = 0.0, 1.02
    columns: dict[str, Any] = {"low": [], "high": [], "middle": [], "share": [], "colour": [], "said": []}
    data = ColumnDataSource(columns, name="enough.data")
    plot.quad(*(0, "share"), "high", "low", color="colour", line_color="white", alpha=0.75, source=data)
    plot.text(0, "middle", text="said", source=data, text_font_size="12px", text_baseline="middle", x_offset=6)

    def content(shown: Snapshot, _: Choice, __: Sequence[Mark]) -> Content:
        bands = shown.bands
        columns = {
            "low": [band.low for band in bands],
            "high": [band.high for band in bands],
            "middle": [0.5 * (band.low + band.high) for band in bands],
            "share": [band.done * band.known for band in bands],
            "colour": [GREEN if band.enough else RED for band in bands],
            "said": [_progress(band) for band in bands],
        }
        return {"sources": {"enough.data": columns}}

    return Drawing("enough", plot, content)


def _progress(band: BandProgress) -> str:
    """Describe the known share of a band, and the error of the FRF relative to the planned error."""
    if not np.isfinite(band.error):
        return "no FRF"
    covered = "" if band.known >= 0.9 else f"{100 * band.known:.0f} % of lines known, "
    reached = "" if band.error > 1 or band.share >= 0.9 else f", reached on {100 * band.share:.0f} % of them"
    return f"{covered}error {number(band.error)} × planned{reached}"


_SPECTRA_SHOWN = 4  # channels in the first choice


def roles(channels: Sequence[Channel]) -> tuple[list[Channel], list[Channel]]:
    """Return excitations and responses in the order of the spectra."""
    from estimation import EXCITING, RESPONDING

    excitations = [channel for channel in channels if channel.quantity in EXCITING and channel.node]
    return excitations, [channel for channel in channels if channel.quantity in RESPONDING]


def names_of(monitor: LiveMonitor) -> dict[str, list[str]]:
    excitations, responses = roles(monitor.channels)
    return {
        "excitations": [channel.name for channel in excitations],
        "responses": [channel.name for channel in responses],
    }


def first_choice(monitor: LiveMonitor) -> Choice:
    """Return the FRF entry and channels that a page shows first."""
    excitations, responses = roles(monitor.channels)
    n = len(excitations) + len(responses)
    return Choice(0, 0, tuple(range(min(n, _SPECTRA_SHOWN))), len(responses), len(excitations))


def all_drawings(monitor: LiveMonitor) -> list[Drawing]:
    """Create the figures of the page; two servers cannot share figures."""
    excitations, responses = roles(monitor.channels)
    drawings = [traces(monitor.channels), levels(monitor.channels)]
    if not excitations or not responses:
        return drawings
    return [
        *drawings,
        spectrum([*excitations, *responses], monitor.band),
        *(transfer(kind, responses, excitations, monitor.band) for kind in ("magnitude", "phase", "coherence")),
        enough(monitor.judged_band),
    ]
