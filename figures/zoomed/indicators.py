"""Mode indicators that zoom."""

from typing import Any

from modal_fit import ComplexModeIndicator, ModalModel, MultivariateModeIndicator

from ..style import FITTED
from .framed import framed, hover, legend_above, look, shared_range
from .plot import ZoomedPlot, as_plot

_MOST_CURVES = 3
_ORDINALS = ("first curve", "second curve", "third curve")


def zoomed_indicators(
    complex_indicator: ComplexModeIndicator, multivariate: MultivariateModeIndicator, model: ModalModel | None = None
) -> ZoomedPlot:
    """Singular values above, eigenvalues of the multivariate indicator beneath.

    Parameters
    ----------
    complex_indicator, multivariate
        Complex and multivariate mode indicators of one FRF in one band.
    model
        Its natural frequencies are marked.
    """
    from bokeh.layouts import column
    from bokeh.models import Span

    f = complex_indicator.frequencies
    band = shared_range((float(f[0]), float(f[-1])))
    sizes = framed("", f"CMIF ({complex_indicator.unit})", band, 280, y_axis_type="log")
    shares = framed("Frequency (Hz)", "MIF (1)", band, 190, y_range=(0.0, 1.02))
    for curve in range(min(_MOST_CURVES, complex_indicator.singular_values.shape[1])):
        values = complex_indicator.singular_values[:, curve]
        drawn = sizes.line(f, values, legend_label=_ORDINALS[curve], **look(curve))
        _told(sizes, drawn, _ORDINALS[curve], "@y{0.000e}")
    for curve in range(min(_MOST_CURVES, multivariate.values.shape[1])):
        drawn = shares.line(multivariate.frequencies, multivariate.values[:, curve], **look(curve))
        _told(shares, drawn, _ORDINALS[curve], "@y{0.000}")
    for frequency in () if model is None else model.natural_frequencies:
        for plot in (sizes, shares):
            plot.add_layout(Span(location=float(frequency), dimension="height", line_color=FITTED, line_dash=[6, 3]))
    legend_above(sizes)
    return as_plot(column(sizes, shares, sizing_mode="stretch_width"))


def _told(plot: Any, drawn: Any, name: str, value: str) -> None:
    hover(plot, [drawn], [(name, value), ("frequency", "@x{0.000} Hz")])
