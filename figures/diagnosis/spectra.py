"""Measured and predicted spectra of the recording that was held out, and what each model leaves."""

import numpy as np
from matplotlib.figure import Figure

from mismatch import HeldOutSpectra

from ..log_axes import decade_axis, plain_log_axis
from ..style import COLOURS, WIDTH_MM, house_style, new_figure

MOST_CHANNELS = 6


def spectra_figure(spectra: HeldOutSpectra) -> Figure:
    """A row a response, the first six: amplitude spectral densities over frequency."""
    count = min(len(spectra.channels), MOST_CHANNELS)
    with house_style():
        height = 18.0 + 46.0 * count
        figure = new_figure(height, None)
        room = {"left": 17 / WIDTH_MM, "right": 1 - 2 / WIDTH_MM, "top": 1 - 7 / height, "bottom": 11 / height}
        panels = figure.add_gridspec(count, 1, hspace=0.06, **room).subplots(squeeze=False, sharex=True)[:, 0]
        for p, axes in enumerate(panels):
            x = spectra.frequencies
            axes.fill_between(x, 1e-30, spectra.noise[:, p], color="#dddddd", linewidth=0, label="Noise")
            axes.plot(x, spectra.measured[:, p], color=COLOURS[0], linewidth=1.8, label="Measured")
            axes.plot(x, spectra.predicted[:, p], color=COLOURS[5], linewidth=0.9, linestyle="--", label="Final model")
            axes.plot(x, spectra.before[:, p], color=COLOURS[1], linestyle=":", label="Left by nominal, refitted")
            axes.plot(x, spectra.after[:, p], color=COLOURS[2], linewidth=1.0, label="Left by final model")
            shown = [spectra.measured[:, p], spectra.after[:, p], spectra.noise[:, p]]
            decade_axis(axes, "y", 0.4 * float(np.nanmin(shown)), 2.0 * float(np.nanmax(shown)))
            unit = spectra.units[p].replace("^2", "²")
            axes.set_ylabel(f"{spectra.channels[p]} ({unit}/√Hz)")
        plain_log_axis(panels[-1], "x", spectra.frequencies[0], spectra.frequencies[-1])
        panels[-1].set_xlabel("Frequency (Hz)")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", ncols=len(labels), borderaxespad=0.2)
    return figure
