"""A recording drawn into axes: one row a channel, each with its own scale."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from acquisition import Stream

from ..axes import given_or_new
from ..style import COLOURS
from .recording import MOST_CHANNELS, envelope


def draw_stream(stream: Stream, axes: Axes | None = None, *, channels: Sequence[str] | None = None) -> Axes:
    """Envelope of each channel over time (largest and smallest sample a bin), rows above each other.

    Each row is scaled by the largest deviation from its mean, which stands beside it with its unit. The recording is
    read once, block by block.

    Parameters
    ----------
    stream
        Samples of one clock.
    axes
        To draw into; None: new ones.
    channels
        Names of the channels to draw; None: all, of more than nine the first nine.

    Raises
    ------
    InputError
        A channel that is not there.
    """
    names = [c.name for c in stream.channels][:MOST_CHANNELS] if channels is None else list(channels)
    shown = [stream.channels[column] for column in stream.columns(names)]
    time, low, high = envelope(stream, names)
    middle = (low.mean(axis=0) + high.mean(axis=0)) / 2
    largest = np.maximum(np.abs(low - middle), np.abs(high - middle)).max(axis=0)
    scale = np.where(largest > 0, largest, 1.0)
    rows = -np.arange(len(names), dtype=float)
    with given_or_new(axes, 14.0 * len(names) + 18.0) as drawn:
        for row, place in enumerate(rows):
            edges = (place + 0.45 * (signal[:, row] - middle[row]) / scale[row] for signal in (low, high))
            drawn.fill_between(time, *edges, color=COLOURS[1], linewidth=0.3)
        levels = [
            f"{channel.name}\n± {size:.3g} {channel.unit.replace('^2', '²')}"
            for channel, size in zip(shown, largest, strict=True)
        ]
        drawn.set_yticks(rows, levels)
        drawn.set_ylim(rows[-1] - 0.6, 0.6)
        drawn.set_xlim(time[0], time[-1])
        drawn.set_xlabel("Time (s)")
    return drawn
