"""Maps of the residual: frequency x channel of each recording, and time x frequency, before and after."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mismatch import BlockResidual, ResidualMap, ResidualView, band_edges

from ..cells import draw_cells
from ..log_axes import plain_log_axis, power_of_ten
from ..style import WIDTH_MM, house_style, new_figure

Real = NDArray[np.float64]

SHADES = "Greys"
STAGES = ("Nominal model, refitted", "Final model")
DARK = 0.55
"""Shade from which on a dot is white."""

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
        plain_log_axis(panels[0, 0], "x", view.before.edges[0], view.before.edges[-1])
        for row, one in enumerate(maps):
            for k in range(columns):
                _channel_axis(panels[row, k], one)
                rows = np.arange(len(one.channels) + 1, dtype=np.float64) - 0.5
                draw_cells(panels[row, k], one.edges, rows, one.ratio[k], shades, SHADES)
            panels[row, 0].set_ylabel(STAGES[row].replace(", ", ",\n"))
        for k, name in enumerate(view.before.recordings):
            _dots(panels[0, k], view.before, view.before.ratio[k], significant[k], shades)
            panels[0, k].set_title(f"{name} ({view.measured[k].recording.level:.3g} N rms)", pad=3)
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
        plain_log_axis(panels[0, 0], "y", edges[0], edges[-1])
        ends = [blocks.times[[0, -1]] for stage in stages for blocks in stage]
        panels[0, 0].set_xlim(np.min(ends), np.max(ends))
        for row, stage in enumerate(stages):
            for k, blocks in enumerate(stage):
                _draw_blocks(panels[row, k], blocks, edges, shades)
            panels[row, 0].set_ylabel(f"{STAGES[row]}\nFrequency (Hz)")
        for k, one in enumerate(view.measured):
            panels[0, k].set_title(f"{one.recording.name} ({one.recording.level:.3g} N rms)", pad=3)
            panels[1, k].set_xlabel("Time (s)")
        _bar(figure, shades, side)
    return figure


def _draw_blocks(axes: Axes, blocks: BlockResidual, edges: Real, shades: LogNorm) -> None:
    power = blocks.banded(edges)[0]
    seen = np.isfinite(power[0])
    steps = np.concatenate([edges[:-1][seen], edges[-1:]])
    draw_cells(axes, blocks.times, steps, power[:, seen], shades, SHADES)


def _channel_axis(axes: Axes, one: ResidualMap) -> None:
    axes.set_yticks(range(len(one.channels)), one.channels)
    axes.set_ylim(len(one.channels) - 0.5, -0.5)
    axes.hlines(np.arange(len(one.channels) - 1) + 0.5, one.edges[0], one.edges[-1], color="white", linewidth=1.5)


def _dots(axes: Axes, one: ResidualMap, ratio: Real, cells: NDArray[np.bool_], shades: LogNorm) -> None:
    """A dot in every significant cell, white on dark shades."""
    middle = np.sqrt(one.edges[1:] * one.edges[:-1])
    dark = np.asarray(shades(ratio)) > DARK
    for colour, chosen in (("white", cells & dark), ("black", cells & ~dark)):
        bands, channels = np.nonzero(chosen)
        axes.plot(middle[bands], channels, ".", color=colour, markersize=2.2)


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
    powers = range(math.floor(math.log10(shades.vmax or LEAST_TOP) + 1e-9) + 1)
    bar.set_ticks([10.0**power for power in powers], labels=[power_of_ten(power) for power in powers])
    bar.ax.minorticks_off()
