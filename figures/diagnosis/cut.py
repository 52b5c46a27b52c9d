"""Figures of a cutting diagnosis: force around the turn of the spindle, and error by spindle order."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.fft import irfft

from mismatch import CutDiagnosis, CutFit

from ..style import COLOURS, legend_above, new_figure

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

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
    _draw(axes, orders, scale * _size(lines.measured), {"color": "0.75", "linewidth": 2.0, "label": "measured force"})
    look = {"color": COLOURS[2], "linestyle": (0, (4, 1.0)), "linewidth": 0.9, "label": "left, cutting file"}
    _draw(axes, orders, scale * _size(_rest(found, found.details.nominal)), look)
    look = {"color": COLOURS[1], "linewidth": 0.9, "label": "left, improved"}
    _draw(axes, orders, scale * _size(_rest(found, shown_fit(found))), look)
    floor = scale * np.sqrt(noise.floor.sum(axis=1))
    _draw(axes, orders, floor, {"color": "k", "linestyle": (0, (1, 1.2)), "label": "noise"})
    axes.set_xlim(0, orders[-1])
    axes.set_xlabel("Spindle order (frequency / spindle frequency)")
    axes.set_ylabel("Amplitude, all channels (N)")
    legend_above(figure, axes)
    return figure


def shown_fit(found: CutDiagnosis) -> CutFit:
    """Give the fit that the improved cutting file stands for."""
    return found.details.final


def _draw(axes: Axes, orders: Real, values: Real, look: dict[str, object]) -> None:
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
    signals = irfft(spectrum, n=lines.size, axis=1) * np.sqrt(lines.size * 0.9375)
    times = (lines.first + np.arange(lines.size * lines.blocks)) / lines.recording.rate
    angles = law.angles(times).reshape(lines.blocks, lines.size)
    kept = slice(lines.size // 8, -(lines.size // 8))
    bins = (np.mod(angles[:, kept], 2 * np.pi) / (2 * np.pi) * BINS).astype(int).ravel() % BINS
    count = np.maximum(np.bincount(bins, minlength=BINS), 1)
    columns = [np.bincount(bins, signals[:, kept, c].ravel(), BINS) / count for c in range(shown.shape[2])]
    return np.stack(columns, axis=-1)
