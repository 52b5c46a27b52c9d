"""Figure of a predicted tip beside the FRFs of the blanks that it was predicted from."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation import Frf, shared_points, to_receptance
from modal_fit import PredictedTip

from .frf import two_deviations
from .style import FITTED, SHADE, house_style, legend_above, line_style, new_figure, panel_letter


@house_style()
def tool_tip_figure(blanks: Mapping[str, Frf], tip: PredictedTip) -> Figure:
    """Draw the direct receptances of blanks and that of a predicted tip with its band, a panel for each direction.

    Parameters
    ----------
    blanks
        Measured FRFs of the blanks by name, of any quantity.
    tip
        Receptance at the tip with its errors.
    """
    predicted = tip.frf
    figure = new_figure(20.0 + 55.0 * len(predicted.responses))
    panels = figure.subplots(len(predicted.responses), 1, sharex=True, squeeze=False)[:, 0]
    for number, (axes, place) in enumerate(zip(panels, predicted.responses, strict=True)):
        axes.set_yscale("log")
        count = 0
        for name, blank in blanks.items():
            for point in shared_points(blank.responses, blank.excitations):
                if point.name[-1] == place[-1]:
                    label = f"measured: {name} at {point.name.partition(':')[0]}"
                    _draw_measured(axes, blank, point.row, point.column, label, count)
                    count += 1
        _draw_predicted(axes, tip, number, f"predicted: {place}")
        axes.set_ylabel(f"|H| in {place[-1]} (m/N)")
        panel_letter(axes, number)
    panels[-1].set_xlabel("Frequency (Hz)")
    panels[-1].set_xlim(predicted.frequencies[0], predicted.frequencies[-1])
    legend_above(figure, panels[0], columns=3)
    return figure


def _draw_measured(axes: Axes, blank: Frf, row: int, column: int, label: str, number: int) -> None:
    frf = to_receptance(blank)
    size = np.where(frf.valid, np.abs(frf.values[:, row, column]), np.nan)
    axes.plot(frf.frequencies, size, label=label, linewidth=0.8, **{**line_style(number), "color": "#7f7f7f"})


def _draw_predicted(axes: Axes, tip: PredictedTip, place: int, label: str) -> None:
    predicted = tip.frf
    size = np.where(predicted.valid, np.abs(predicted.values[:, place, place]), np.nan)
    low, high = two_deviations(size, tip.deviation[:, place])
    axes.fill_between(predicted.frequencies, low, high, color=SHADE, linewidth=0, label="± 2 standard deviations")
    axes.plot(predicted.frequencies, size, color=FITTED, label=label)
