"""Figure of recorded cuts: each over time and frequency, and its spectrum."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.core import Real

from .cuts import ShownCut, draw_cut_spectrum
from .style import COLOURS, house_style, legend_above, new_figure

_RANGE_DB = 60.0  # between the largest and the smallest power that is drawn
_COLUMNS = 400  # instants that are drawn at most


@dataclass(frozen=True)
class RecordedCut:
    """A cut with its spectrum, and its recording."""

    shown: ShownCut
    rpm: float  # spindle speed
    samples: Real  # (n_samples,) of the channel that shows the cut best
    sample_rate: float  # Hz


def cut_over_time_figure(cuts: Sequence[RecordedCut]) -> Figure:
    """Draw two panels per cut: power over time and frequency with the line of chatter, and the spectrum of the cut."""
    with house_style():
        figure = new_figure(8.0 + 105.0 * len(cuts))
        panels = np.atleast_2d(figure.subplots(2 * len(cuts), 1)).reshape(len(cuts), 2)
        for (over_time, spectrum), cut in zip(panels, cuts, strict=True):
            _draw_over_time(over_time, cut)
            draw_cut_spectrum(spectrum, cut.shown)
            spectrum.set(title="", xlabel="Frequency (Hz)")
        legend_above(figure, panels[0, 1], columns=3)
    return figure


def _draw_over_time(axes: Axes, cut: RecordedCut) -> None:
    highest = float(cut.shown.spectrum.frequencies[-1])
    # a segment of 16 turns separates the orders of the spindle
    length = int(np.clip(16 * 60 / cut.rpm * cut.sample_rate, 64, len(cut.samples)))
    hop = max(length // 4, (len(cut.samples) - length) // _COLUMNS, 1)
    frequencies, times, power = scipy.signal.spectrogram(
        cut.samples - cut.samples.mean(), cut.sample_rate, "hann", length, length - hop, mode="psd"
    )
    shown = frequencies <= highest
    level = 10 * np.log10(np.maximum(power[shown], 1e-300))
    top = float(level.max())
    image = axes.pcolormesh(
        times, frequencies[shown], level - top, cmap="Greys", vmin=-_RANGE_DB, vmax=0.0, rasterized=True
    )
    axes.figure.colorbar(image, ax=axes, label="Power (dB re largest)", pad=0.01)
    frequency = cut.shown.verdict.frequency
    if np.isfinite(frequency):
        axes.plot([times[0], times[-1]], [frequency] * 2, color=COLOURS[3], lw=0.8, ls=(0, (6, 6)))
        axes.annotate(
            f"chatter, {frequency:.4g} Hz", (times[-1], frequency), (0, 3), textcoords="offset points", ha="right",
            color=COLOURS[3], fontsize=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
        )  # fmt: skip
    axes.set(title=cut.shown.title, xlabel="Time (s)", ylabel="Frequency (Hz)")
