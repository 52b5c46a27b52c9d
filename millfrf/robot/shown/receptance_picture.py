"""Receptance at the tool tip as a picture: amplitude and phase of the direct entries, the largest cross entry."""

import numpy as np
from matplotlib.figure import Figure

from estimation import Frf
from millfrf.figures import COLOURS, LINE_STYLES, house_style, new_figure, panel_letter


def receptance_figure(frf: Frf, resonances: np.ndarray) -> Figure:
    """Draw direct receptances over frequency, and in grey the largest that couples two directions.

    Parameters
    ----------
    frf
        Receptance at the tool tip, m/N.
    resonances : (n,), Hz
        Natural frequencies, marked on the axis.
    """
    names = [label.split(":")[1].lstrip("+") for label in frf.responses]
    direct = [(name, frf.values[:, i, i]) for i, name in enumerate(names)]
    apart = np.abs(frf.values) * (1 - np.eye(len(names)))
    with house_style():
        figure = new_figure(110.0)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
        if len(names) > 1:
            cross = apart.reshape(len(apart), -1).max(axis=1)
            upper.semilogy(frf.frequencies, 1e6 * cross, color="0.65", linewidth=1.0, label="largest across")
        for number, (name, values) in enumerate(direct):
            style = {"color": COLOURS[number], "linestyle": LINE_STYLES[number % len(LINE_STYLES)]}
            upper.semilogy(frf.frequencies, 1e6 * np.abs(values), label=f"{name} under force in {name}", **style)
            lower.plot(frf.frequencies, np.degrees(np.angle(values)), **style)
        shown = resonances[(resonances >= frf.frequencies[0]) & (resonances <= frf.frequencies[-1])]
        for axes in (upper, lower):
            for value in shown:
                axes.axvline(value, color="0.8", linewidth=0.6, zorder=0)
        upper.set_ylabel("Receptance (µm/N)")
        lower.set_ylabel("Phase (degrees)")
        lower.set_ylim(-190, 190)
        lower.set_yticks([-180, -90, 0, 90, 180])
        lower.set_xlabel("Frequency (Hz)")
        lower.set_xlim(frf.frequencies[0], frf.frequencies[-1])
        for number, axes in enumerate((upper, lower)):
            panel_letter(axes, number)
        handles, labels = upper.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure
