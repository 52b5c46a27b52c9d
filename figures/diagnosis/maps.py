"""Maps of the residual: frequency x channel of each recording, and time x frequency, before and after."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, ScalarFormatter
from numpy.typing import NDArray

from mismatch import BlockResidual, ResidualMap, ResidualView, band_edges

from ..style import WIDTH_MM, house_style, new_figure

Real = NDArray[np.float64]

SHADES = "Greys"
STAGES = ("Nominal model, refitted", "Final model")
LEAST_TOP = 10.0
"""Least upper end of the scale: less than ten times the noise is not drawn black."""


def channel_map_figure(view: ResidualView, significant: NDArray[np.bool_]) -> Figure:
    """Draw residual power over noise power, a column a recording, upper row before and lower row after the causes.

    Parameters
    ----------
    view
        Maps of the residual before and after the causes.
    significant : (n_recordings, n_bands, n_responses), bool
        Whether a cell gets a dot in the upper row.
    """
    maps = (view.before, view.after)
    shades = _shades([one.ratio for one in maps])
    columns = len(view.before.recordings)
    with house_style():
        figure, panels, side = _panels(columns, 24.0 + 2 * (8.0 + 6.5 * len(view.before.channels)))
        for row, one in enumerate(maps):
            for k in range(columns):
                panels[row, k].pcolormesh(*_channel_grid(one), one.ratio[k].T, norm=shades, cmap=SHADES)
                _channel_axis(panels[row, k], one)
            panels[row, 0].set_ylabel(STAGES[row].replace(", ", ",\n"))
        for k, name in enumerate(view.before.recordings):
            _dots(panels[0, k], view.before, view.before.ratio[k], significant[k], shades)
            panels[0, k].set_title(f"{name} ({view.measured[k].recording.level:.3g} N rms)", pad=3)
            _frequency_axis(panels[1, k].xaxis, view.before.edges)
            panels[1, k].set_xlabel("Frequency (Hz)")
        _bar(figure, shades, side)
    return figure


def time_map_figure(view: ResidualView) -> Figure:
    """Residual power over noise power in blocks of time, a column a recording; before above, after below."""
    edges = band_edges(view.measured, 4, 1)
    stages = (view.blocks_before, view.blocks_after)
    shades = _shades([blocks.banded(edges)[0] for stage in stages for blocks in stage])
    with house_style():
        figure, panels, side = _panels(len(view.measured), 105.0)
        for row, stage in enumerate(stages):
            for k, blocks in enumerate(stage):
                _draw_blocks(panels[row, k], blocks, edges, shades)
            panels[row, 0].set_ylabel(f"{STAGES[row]}\nfrequency (Hz)")
        for k, one in enumerate(view.measured):
            panels[0, k].set_title(f"{one.recording.name} ({one.recording.level:.3g} N rms)", pad=3)
            panels[1, k].set_xlabel("Time (s)")
        _bar(figure, shades, side)
    return figure


def _draw_blocks(axes: Axes, blocks: BlockResidual, edges: Real, shades: LogNorm) -> None:
    power = blocks.banded(edges)[0]
    seen = np.isfinite(power[0])
    steps = np.concatenate([edges[:-1][seen], edges[-1:]])
    axes.pcolormesh(blocks.times, steps, power[:, seen].T, norm=shades, cmap=SHADES, rasterized=True)
    axes.set_yscale("log")
    axes.set_ylim(edges[0], edges[-1])
    _frequency_axis(axes.yaxis, edges)
    axes.grid(visible=False)


def _channel_grid(one: ResidualMap) -> tuple[Real, Real]:
    return one.edges, np.asarray(np.arange(len(one.channels) + 1) - 0.5, dtype=np.float64)


def _channel_axis(axes: Axes, one: ResidualMap) -> None:
    axes.set_xscale("log")
    axes.set_xlim(one.edges[0], one.edges[-1])
    axes.set_yticks(range(len(one.channels)), one.channels)
    axes.set_ylim(len(one.channels) - 0.5, -0.5)
    axes.grid(visible=False)
    axes.hlines(np.arange(len(one.channels) - 1) + 0.5, one.edges[0], one.edges[-1], color="white", linewidth=1.5)


def _frequency_axis(axis: object, edges: Real) -> None:
    """1-2-5 ticks with plain numbers."""
    decades = 10.0 ** np.arange(-3, 6)
    ticks = np.array([1, 2, 5])[:, None] * decades
    inside = np.sort(ticks[(ticks >= edges[0]) & (ticks <= edges[-1])])
    axis.set_major_locator(FixedLocator(inside.tolist()))  # type: ignore[attr-defined]
    axis.set_major_formatter(ScalarFormatter())  # type: ignore[attr-defined]
    axis.set_minor_formatter(NullFormatter())  # type: ignore[attr-defined]


def _dots(axes: Axes, one: ResidualMap, ratio: Real, cells: NDArray[np.bool_], shades: LogNorm) -> None:
    """A dot in every significant cell, white on dark shades."""
    middle = np.sqrt(one.edges[1:] * one.edges[:-1])
    for band, channel in np.argwhere(cells):
        dark = float(shades(ratio[band, channel]))
        axes.plot(middle[band], channel, ".", color="white" if dark > 0.55 else "black", markersize=2.2)


def _shades(ratios: Sequence[Real]) -> LogNorm:
    largest = max(float(np.nanmax(ratio)) for ratio in ratios)
    return LogNorm(1.0, max(largest, LEAST_TOP), clip=True)


def _panels(columns: int, height: float) -> tuple[Figure, NDArray[np.object_], Axes]:
    """Two rows of panels placed in millimetres, and the axes of the scale at their right."""
    figure = new_figure(height, None)
    top, bottom = 1 - 6 / height, 11 / height
    grid = figure.add_gridspec(
        2, columns, left=21 / WIDTH_MM, right=1 - 20 / WIDTH_MM, top=top, bottom=bottom, wspace=0.05, hspace=0.08
    )
    panels = grid.subplots(squeeze=False, sharex=True, sharey=True)
    side = figure.add_axes((1 - 17.5 / WIDTH_MM, bottom, 3.2 / WIDTH_MM, top - bottom))
    return figure, panels, side


def _bar(figure: Figure, shades: LogNorm, side: Axes) -> None:
    bar = figure.colorbar(ScalarMappable(shades, SHADES), cax=side)
    bar.set_label("Residual power / noise power")
    bar.ax.yaxis.set_major_locator(LogLocator(10))
    bar.ax.minorticks_off()
