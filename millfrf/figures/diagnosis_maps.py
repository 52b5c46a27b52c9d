"""Maps and spectra of the residual of a diagnosis."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from millfrf.core import Real
from millfrf.mismatch import (
    BlockResidual,
    HeldOutSpectra,
    ResidualMap,
    ResidualView,
    RobotDiagnosis,
    band_edges,
    predicted_spectrum,
)

from .style import COLOURS, WIDTH_MM, decade_axis, house_style, legend_above, new_figure, plain_log_axis, power_of_ten


def robot_spectra_figure(diagnosis: RobotDiagnosis) -> Figure:
    """Draw response over force, all channels together, one panel per posture: measured, nominal and changed model."""
    recordings = diagnosis.details.robot.recordings
    figure = new_figure(62.0 + 12.0 * (len(recordings) > 3))
    panels = figure.subplots(1, len(recordings), squeeze=False, sharey=True)[0]
    before, after = (
        diagnosis.details.robot.modes(fit.changes) for fit in (diagnosis.details.nominal, diagnosis.details.final)
    )
    for number, (axes, recording) in enumerate(zip(panels, recordings, strict=True)):
        spectrum = recording.spectrum
        curves: list[tuple[Any, dict[str, Any]]] = [
            (spectrum.measured, {"color": "0.65", "linewidth": 2.2, "label": "measured"}),
            (
                predicted_spectrum(before[number], spectrum),
                {"color": COLOURS[2], "linestyle": (0, (4, 1.5)), "label": "as modelled"},
            ),
        ]
        if diagnosis.physics:
            changed = predicted_spectrum(after[number], spectrum)
            curves.append((changed, {"color": COLOURS[1], "label": "with the change"}))
        force = _averaged(np.sum(np.abs(spectrum.force_here) ** 2, axis=1))
        x = _averaged(spectrum.frequencies)
        shift = _averaged(np.abs(spectrum.kinematic[:, 0]))
        for values, style in curves:
            power = _averaged(np.sum(np.abs(values) ** 2, axis=1))
            axes.semilogy(x, 1e6 * np.sqrt(power / force) / shift, **style)
        axes.set_title(recording.name)
        axes.set_xlabel("Frequency (Hz)")
    panels[0].set_ylabel("Receptance, all channels (µm/N)")
    legend_above(figure, panels[0])
    return figure


def _averaged(values: Real) -> Real:
    """Average neighbouring lines to about 250 points."""
    size = max(1, len(values) // 250)
    count = len(values) // size * size
    return np.asarray(values[:count].reshape(-1, size).mean(axis=1))


def robot_evidence_figure(diagnosis: RobotDiagnosis) -> Figure:
    """Draw the evidence of every candidate, best on top, on a symmetric logarithmic scale."""
    causes = diagnosis.candidates[::-1]
    figure = new_figure(18.0 + 5.0 * len(causes))
    axes = figure.subplots()
    accepted = {cause.name for cause in diagnosis.physics} | set(diagnosis.equivalents)
    colours = [COLOURS[1] if cause.name in accepted else "0.7" for cause in causes]
    axes.barh([cause.name for cause in causes], [cause.evidence for cause in causes], color=colours, height=0.7)
    axes.set_xscale("symlog", linthresh=20.0, linscale=0.5)
    reach = max(20.0, causes[-1].evidence)
    ticks = [tick for tick in (-10, 0, 10, 20, 50, 100, 200, 500, 1e3, 1e4, 1e5, 1e6) if tick <= 1.2 * reach]
    axes.set_xticks(ticks, [f"{tick:g}".replace("-", "−") for tick in ticks], minor=False)
    axes.set_xticks([], minor=True)
    axes.axvline(20.0, color="k", linewidth=0.8, linestyle="--")
    axes.text(20.0, len(causes) - 0.35, " least that is accepted", va="bottom", ha="left")
    axes.set_xlim(left=min(-20.0, 1.2 * causes[0].evidence))
    axes.set_ylim(top=len(causes) + 0.6)
    axes.set_xlabel("Evidence: gain in score over the robot as modelled")
    axes.grid(axis="y", visible=False)
    return figure


def spectra_figure(spectra: HeldOutSpectra) -> Figure:
    """Draw amplitude spectral densities over frequency, one row per response; the first six."""
    count = min(len(spectra.channels), 6)
    with house_style():
        height = 18.0 + 46.0 * count
        figure = new_figure(height, None)
        margins = {"left": 17 / WIDTH_MM, "right": 1 - 2 / WIDTH_MM, "top": 1 - 7 / height, "bottom": 11 / height}
        panels = figure.add_gridspec(count, 1, hspace=0.06, **margins).subplots(squeeze=False, sharex=True)[:, 0]
        for p, axes in enumerate(panels):
            x = spectra.frequencies
            axes.fill_between(x, 1e-30, spectra.noise[:, p], color="#dddddd", linewidth=0, label="Noise")
            axes.plot(x, spectra.measured[:, p], color=COLOURS[0], linewidth=1.8, label="Measured")
            axes.plot(x, spectra.predicted[:, p], color=COLOURS[5], linewidth=0.9, linestyle="--", label="Final model")
            axes.plot(x, spectra.before[:, p], color=COLOURS[1], linestyle=":", label="Residual of nominal, refitted")
            axes.plot(x, spectra.after[:, p], color=COLOURS[2], linewidth=1.0, label="Residual of final model")
            shown = [spectra.measured[:, p], spectra.after[:, p], spectra.noise[:, p]]
            decade_axis(axes, "y", 0.4 * float(np.nanmin(shown)), 2.0 * float(np.nanmax(shown)))
            unit = spectra.units[p].replace("^2", "²")
            axes.set_ylabel(f"{spectra.channels[p]} ({unit}/√Hz)")
        plain_log_axis(panels[-1], "x", spectra.frequencies[0], spectra.frequencies[-1])
        panels[-1].set_xlabel("Frequency (Hz)")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", ncols=len(labels), borderaxespad=0.2)
    return figure


PIXELS = 600  # along an axis of cells with different widths; a pixel is smaller than a tenth of a millimetre
MIN_PIXELS = 150  # along an axis of cells with equal widths, so that viewers that smooth pictures blur no edge


def draw_cells(axes: Axes, x_edges: Real, y_edges: Real, values: Real, shades: Normalize, cmap: str) -> None:
    """Draw cells as an image, at positions that follow from the present scales and limits of the axes.

    Parameters
    ----------
    axes
        Axes with linear or logarithmic scales, and with their final limits.
    x_edges, y_edges : (n_x + 1,), (n_y + 1,)
        Edges of the cells along both axes.
    values : (n_x, n_y)
        A value for each cell.
    shades, cmap
        Scale of the values, and its colours.
    """
    left, right, columns = _sampled(_fractions(axes, "x", x_edges))
    bottom, top, rows = _sampled(_fractions(axes, "y", y_edges))
    image = AxesImage(axes, cmap=cmap, norm=shades, interpolation="none", origin="lower", zorder=0.5)
    image.set_data(values[np.ix_(columns, rows)].T)
    image.set_transform(axes.transAxes)  # an image cannot be stretched along a logarithmic axis
    image.set_clip_path(axes.patch)
    image.set_extent((left, right, bottom, top))
    axes.add_image(image)


def _fractions(axes: Axes, side: str, edges: Real) -> Real:
    """Return the positions of cell edges as fractions of the width or height of the axes."""
    low, high = getattr(axes, f"get_{side}lim")()
    if getattr(axes, f"get_{side}scale")() == "log":
        low, high, edges = np.log(low), np.log(high), np.log(edges)
    return np.asarray((edges - low) / (high - low))


def _sampled(edges: Real) -> tuple[float, float, NDArray[np.int64]]:
    """Return the lower and upper edge of all cells, and the number of the cell at each pixel between both edges."""
    widths = np.diff(edges)
    if np.allclose(widths, widths[0], rtol=1e-3):
        cells = np.repeat(np.arange(len(widths)), -(-MIN_PIXELS // len(widths)))
    else:
        middles = (np.arange(PIXELS) + 0.5) / PIXELS
        cells = np.searchsorted((edges[1:-1] - edges[0]) / (edges[-1] - edges[0]), middles)
    low, high = float(edges[0]), float(edges[-1])
    return (low, high, cells) if low < high else (high, low, cells[::-1])


SHADES = "Greys"
STAGES = ("Nominal model, refitted", "Final model")
MIN_TOP = 10.0  # smallest upper end of the scale: less than ten times the noise is not drawn black


def channel_map_figure(view: ResidualView, significant: NDArray[np.bool_]) -> Figure:
    """Draw residual power over noise power, one column per recording, before (top) and after the causes are added.

    Parameters
    ----------
    view
        Maps of the residual before and after the causes.
    significant : (n_recordings, n_bands, n_responses), bool
        Cells with a dot in the upper row.
    """
    maps = (view.before, view.after)
    shades = _shades([residual.ratio for residual in maps])
    columns = len(view.before.recordings)
    with house_style():
        figure, panels, side = _panels(columns, 28.0 + 2 * (8.0 + 6.5 * len(view.before.channels)))
        plain_log_axis(panels[0, 0], "x", view.before.edges[0], view.before.edges[-1])
        for row, residual in enumerate(maps):
            for k in range(columns):
                _channel_axis(panels[row, k], residual)
                rows = np.arange(len(residual.channels) + 1, dtype=np.float64) - 0.5
                draw_cells(panels[row, k], residual.edges, rows, residual.ratio[k], shades, SHADES)
            panels[row, 0].set_ylabel(STAGES[row].replace(", ", ",\n"))
        for k, name in enumerate(view.before.recordings):
            _dots(panels[0, k], view.before, view.before.ratio[k], significant[k], shades)
            _name_column(panels[0, k], name, view.measured[k].recording.level, columns)
            panels[1, k].set_xlabel("Frequency (Hz)")
        _bar(figure, shades, side)
    return figure


def time_map_figure(view: ResidualView) -> Figure:
    """Draw residual power over noise power in blocks of time, one column per recording.

    The upper row shows the residual before the causes are added, the lower row the residual afterwards."""
    edges = band_edges(view.measured, 4, 1)
    stages = (view.blocks_before, view.blocks_after)
    shades = _shades([blocks.banded(edges) for stage in stages for blocks in stage])
    with house_style():
        figure, panels, side = _panels(len(view.measured), 109.0)
        plain_log_axis(panels[0, 0], "y", edges[0], edges[-1])
        ends = [blocks.times[[0, -1]] for stage in stages for blocks in stage]
        panels[0, 0].set_xlim(np.min(ends), np.max(ends))
        for row, stage in enumerate(stages):
            for k, blocks in enumerate(stage):
                _draw_blocks(panels[row, k], blocks, edges, shades)
            panels[row, 0].set_ylabel(f"{STAGES[row]}\nFrequency (Hz)")
        for k, spectra in enumerate(view.measured):
            _name_column(panels[0, k], spectra.recording.name, spectra.recording.level, len(view.measured))
            panels[1, k].set_xlabel("Time (s)")
        _bar(figure, shades, side)
    return figure


def _name_column(axes: Axes, name: str, level: float, columns: int) -> None:
    """Write name and level of a recording above its column, so small that neighbours do not touch."""
    lines = [*textwrap.wrap(name, max(6, 60 // columns)), f"{level:.3g} N rms"]
    axes.set_title("\n".join(lines[-3:]), pad=3, fontsize=9 if columns < 4 else 7)


def _draw_blocks(axes: Axes, blocks: BlockResidual, edges: Real, shades: LogNorm) -> None:
    power = blocks.banded(edges)
    known = np.isfinite(power[0])
    steps = np.concatenate([edges[:-1][known], edges[-1:]])
    draw_cells(axes, blocks.times, steps, power[:, known], shades, SHADES)


def _channel_axis(axes: Axes, residual: ResidualMap) -> None:
    axes.set_yticks(range(len(residual.channels)), residual.channels)
    axes.set_ylim(len(residual.channels) - 0.5, -0.5)
    boundaries = np.arange(len(residual.channels) - 1) + 0.5
    axes.hlines(boundaries, residual.edges[0], residual.edges[-1], color="white", linewidth=1.5)


def _dots(axes: Axes, residual: ResidualMap, ratio: Real, cells: NDArray[np.bool_], shades: LogNorm) -> None:
    """Draw a dot in every significant cell: white in dark cells, black in bright cells."""
    middle = np.sqrt(residual.edges[1:] * residual.edges[:-1])
    dark = np.asarray(shades(ratio)) > 0.55
    for colour, chosen in (("white", cells & dark), ("black", cells & ~dark)):
        bands, channels = np.nonzero(chosen)
        axes.plot(middle[bands], channels, ".", color=colour, markersize=2.2)


def _shades(ratios: Sequence[Real]) -> LogNorm:
    largest = max(float(np.nanmax(ratio)) for ratio in ratios)
    return LogNorm(1.0, max(largest, MIN_TOP), clip=True)


def _panels(columns: int, height: float) -> tuple[Figure, NDArray[np.object_], Axes]:
    """Make two rows of panels placed in millimetres, and the axes of the colour scale at their right."""
    figure = new_figure(height, None)
    top, bottom = 1 - 10 / height, 11 / height
    grid = figure.add_gridspec(
        2, columns, left=21 / WIDTH_MM, right=1 - 20 / WIDTH_MM, top=top, bottom=bottom, wspace=0.05, hspace=0.08
    )
    with rc_context({"axes.grid": False}):
        panels = grid.subplots(squeeze=False, sharex=True, sharey=True)
        side = figure.add_axes((1 - 17.5 / WIDTH_MM, bottom, 3.2 / WIDTH_MM, top - bottom))
    for axes in panels[:, 1:].ravel():
        axes.yaxis.set_visible(False)
    for axes in panels[0]:
        axes.xaxis.set_visible(False)
    return figure, panels, side


def _bar(figure: Figure, shades: LogNorm, side: Axes) -> None:
    bar = figure.colorbar(ScalarMappable(shades, SHADES), cax=side)
    bar.set_label("Residual power / noise power")
    powers = range(math.floor(math.log10(shades.vmax or MIN_TOP) + 1e-9) + 1)
    bar.set_ticks([10.0**power for power in powers], labels=[power_of_ten(power) for power in powers])
    bar.ax.minorticks_off()
