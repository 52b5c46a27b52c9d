"""Mode indicators over the band of a fit, with the fitted modes marked."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal_fit import ComplexModeIndicator, ModalModel, MultivariateModeIndicator

from ..style import COLOURS, FITTED, LINE_STYLES, house_style, legend_above, new_figure, panel_letter

_MOST_CURVES = 3


def indicator_figure(
    complex_indicator: ComplexModeIndicator, multivariate: MultivariateModeIndicator, model: ModalModel | None = None
) -> Figure:
    """Singular values above, eigenvalues of the multivariate indicator beneath; three curves each.

    Parameters
    ----------
    complex_indicator, multivariate
        Complex and multivariate mode indicators of one FRF in one band.
    model
        Its natural frequencies are marked.
    """
    with house_style():
        figure = new_figure(110.0)
        sizes, shares = figure.subplots(2, 1, sharex=True, height_ratios=[1.5, 1.0])
        for curve in range(min(_MOST_CURVES, complex_indicator.singular_values.shape[1])):
            values = complex_indicator.singular_values[:, curve]
            sizes.semilogy(complex_indicator.frequencies, values, label=_ordinal(curve), **_line(curve))
        for curve in range(min(_MOST_CURVES, multivariate.values.shape[1])):
            shares.plot(multivariate.frequencies, multivariate.values[:, curve], **_line(curve))
        if model is not None:
            _mark(sizes, shares, model)
        sizes.set_ylabel(f"CMIF ({complex_indicator.unit})")
        shares.set_ylabel("MIF (1)")
        shares.set_ylim(0, 1.02)
        shares.set_xlabel("Frequency (Hz)")
        shares.set_xlim(complex_indicator.frequencies[0], complex_indicator.frequencies[-1])
        panel_letter(sizes, 0)
        panel_letter(shares, 1)
        legend_above(figure, sizes)
    return figure


def _line(curve: int) -> dict[str, object]:
    return {"color": COLOURS[curve if curve < 2 else 3], "linestyle": LINE_STYLES[curve], "linewidth": 1.1}


def _ordinal(curve: int) -> str:
    return ("first curve", "second curve", "third curve")[curve]


def _mark(sizes: Axes, shares: Axes, model: ModalModel) -> None:
    """Thin lines behind the curves."""
    for number, frequency in enumerate(model.natural_frequencies):
        for axes in (sizes, shares):
            label = "mode of the fitted model" if number == 0 and axes is sizes else None
            axes.axvline(frequency, color=FITTED, linewidth=0.8, linestyle=(0, (5, 1.5)), label=label, zorder=1)
