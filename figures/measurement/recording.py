"""Overview of a recording: every channel's envelope over the whole time, and a closer look in the middle."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from acquisition import Channel, Stream

from ..style import COLOURS, house_style, new_figure

BINS = 600
MOST_CHANNELS = 9


def time_figure(stream: Stream, *, zoom_seconds: float = 0.25, channels: Sequence[str] | None = None) -> Figure:
    """Envelope (largest and smallest sample a bin) left, ``zoom_seconds`` of samples right, a row a channel.

    The recording is read once, block by block; of more than nine channels the first nine are shown.
    """
    shown = tuple(c for c in stream.channels if channels is None or c.name in channels)[:MOST_CHANNELS]
    names = [channel.name for channel in shown]
    edges, low, high = envelope(stream, names)
    middle = stream.n_samples // 2
    stop = min(stream.n_samples, middle + max(2, round(zoom_seconds * stream.sample_rate)))
    close = stream.read(middle, stop, names)
    time = stream.start_time + np.arange(middle, stop) / stream.sample_rate
    with house_style():
        height = 19.0 * len(shown) + 17.0
        figure = new_figure(height, None)
        room = {"left": 0.095, "right": 0.99, "wspace": 0.16, "hspace": 0.22, "top": 1 - 6 / height}
        grid = figure.add_gridspec(len(shown), 2, width_ratios=[1.7, 1.0], bottom=11 / height, **room)
        panels = grid.subplots(squeeze=False, sharex="col")
        for row, channel in enumerate(shown):
            _draw(panels[row, 0], panels[row, 1], channel)
            panels[row, 0].fill_between(edges, low[:, row], high[:, row], color=_colour(channel), linewidth=0.2)
            panels[row, 1].plot(time, close[:, row], color=_colour(channel), linewidth=0.7)
        for column in (0, 1):
            panels[-1, column].set_xlabel("Time (s)")
        panels[0, 0].set_title("Whole recording (envelope)", pad=3)
        panels[0, 1].set_title("A closer look", pad=3)
        panels[0, 0].set_xlim(edges[0], edges[-1])
        panels[0, 1].set_xlim(time[0], time[-1])
        figure.align_ylabels(panels[:, 0])
    return figure


def envelope(
    stream: Stream, names: Sequence[str], bins: int = BINS
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Time of each bin (s) and the smallest and largest sample in it, (n_bins,), (n_bins, n_channels) twice."""
    length = max(1, -(-stream.n_samples // bins))
    low, high = [], []
    for block in stream.blocks(length * max(1, (1 << 16) // length), names):
        for start in range(0, len(block), length):
            part = block[start : start + length]
            low.append(part.min(axis=0))
            high.append(part.max(axis=0))
    time = stream.start_time + (np.arange(len(low)) + 0.5) * length / stream.sample_rate
    return np.asarray(time, dtype=np.float64), np.array(low), np.array(high)


def _draw(whole: Axes, close: Axes, channel: Channel) -> None:
    whole.set_ylabel(f"{channel.name}\n({channel.unit.replace('^2', '²')})")
    for axes in (whole, close):
        axes.locator_params(axis="y", nbins=3)
    close.tick_params(labelleft=True)


def _colour(channel: Channel) -> str:
    kinds = ("force", "acceleration", "displacement", "voltage", "velocity")
    return COLOURS[1 + kinds.index(channel.quantity)] if channel.quantity in kinds else COLOURS[0]
