"""Sum of all FRFs: measured, synthesised, and what the model leaves."""

import numpy as np
from matplotlib.figure import Figure

from modal_fit import Synthesis

from ..style import FITTED, MEASURED, TRUE, house_style, legend_above, new_figure


def synthesis_figure(compared: Synthesis, unit: str) -> Figure:
    """Draw the sums of magnitudes over the entries that the model has.

    Parameters
    ----------
    compared
        FRFs of the measurement and of the model.
    unit
        Unit of both FRFs.
    """
    known = np.isfinite(compared.misfit)
    measured, made = compared.measured[:, known], compared.synthesised[:, known]
    with house_style():
        figure = new_figure(75.0)
        axes = figure.subplots()
        f = compared.frequencies
        axes.semilogy(f, np.abs(measured).sum(axis=1), color=MEASURED, linewidth=1.2, label="measured")
        dashed = {"color": FITTED, "linestyle": (0, (5, 1.5)), "linewidth": 1.2}
        axes.semilogy(f, np.abs(made).sum(axis=1), label="synthesised", **dashed)
        dotted = {"color": TRUE, "linestyle": (0, (1, 1.2)), "linewidth": 1.2}
        axes.semilogy(f, np.abs(measured - made).sum(axis=1), label="difference", **dotted)
        axes.set_xlim(f[0], f[-1])
        axes.set_xlabel("Frequency (Hz)")
        axes.set_ylabel(f"Σ|H| ({unit})")
        legend_above(figure, axes)
    return figure
