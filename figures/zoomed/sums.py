"""The sum of all FRFs, measured, synthesised and their difference, that zooms."""

import numpy as np

from modal_fit import Synthesis

from .framed import framed, hover, legend_above, look, shared_range
from .plot import ZoomedPlot, as_plot


def zoomed_sums(compared: Synthesis, unit: str) -> ZoomedPlot:
    """Sums of magnitudes over the entries that the model has.

    Parameters
    ----------
    compared
        FRFs of the measurement and of the model.
    unit
        Unit of both FRFs.
    """
    known, f = np.isfinite(compared.misfit), compared.frequencies
    measured, made = compared.measured[:, known], compared.synthesised[:, known]
    plot = framed("Frequency (Hz)", f"Σ|H| ({unit})", shared_range((float(f[0]), float(f[-1]))), 340, y_axis_type="log")
    curves = {"measured": measured, "synthesised": made, "difference": measured - made}
    for number, (name, values) in enumerate(curves.items()):
        drawn = plot.line(f, np.abs(values).sum(axis=1), legend_label=name, **look(number))
        hover(plot, [drawn], [(name, "@y{0.000e}"), ("frequency", "@x{0.000} Hz")])
    legend_above(plot)
    return as_plot(plot)
