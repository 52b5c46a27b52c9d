"""`H_pq` over `H_qp`, and their relative difference beneath, for the pairs that matter most."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from estimation import ReciprocityPair

from ..style import FITTED, WIDTH_MM, house_style, new_figure

_COLUMNS = 3
_ROW, _TOP, _LEFT, _GAP = 58.0, 3.0, 17.0, 5.0
_MAGNITUDE, _DIFFERENCE = (6.0, 26.0), (34.0, 13.0)
"""Top edge and height within a row, mm."""


def reciprocity_figure(pairs: Sequence[ReciprocityPair], unit: str) -> Figure:
    """Draw pairs of FRFs that reciprocity makes equal, three pairs a row.

    Parameters
    ----------
    pairs
        Pairs to draw, at most six or so.
    unit
        Unit of the FRF.
    """
    rows = -(-len(pairs) // _COLUMNS)
    height = _TOP + rows * _ROW
    values = np.concatenate([np.abs(np.append(pair.forth, pair.back)) for pair in pairs])
    limits = 0.7 * values[values > 0].min(initial=values.max()), 1.5 * values.max()
    with house_style():
        figure = new_figure(height, None)
        for number, pair in enumerate(pairs):
            row, column = divmod(number, _COLUMNS)
            width = (WIDTH_MM - _LEFT - 5 - _GAP * (_COLUMNS - 1)) / _COLUMNS
            left = _LEFT + column * (width + _GAP)
            panels = [
                figure.add_axes(
                    (
                        left / WIDTH_MM,
                        (height - _TOP - row * _ROW - top - tall) / height,
                        width / WIDTH_MM,
                        tall / height,
                    )
                )
                for top, tall in (_MAGNITUDE, _DIFFERENCE)
            ]
            _draw(panels[0], panels[1], pair, unit, outer=column == 0)
            panels[0].set_ylim(max(limits[0], 1e-5 * limits[1]), limits[1])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", ncols=2, borderaxespad=0.1)
    return figure


def _draw(magnitude: Axes, difference: Axes, pair: ReciprocityPair, unit: str, *, outer: bool) -> None:
    magnitude.semilogy(pair.frequencies, abs(pair.forth), color="#000000", linewidth=0.9, label="p / q")
    magnitude.semilogy(
        pair.frequencies, abs(pair.back), color=FITTED, linewidth=0.9, linestyle=(0, (5, 1.5)), label="q / p"
    )
    difference.plot(pair.frequencies, 100 * pair.difference_over_frequency, color="#000000", linewidth=0.8)
    magnitude.set_title(f"{pair.first} / {pair.second}", pad=3)
    magnitude.tick_params(labelbottom=False, labelleft=outer)
    difference.set_ylim(0, 205)
    difference.set_yticks([0, 100, 200])
    difference.tick_params(labelleft=outer)
    difference.set_xlabel("Frequency (Hz)")
    difference.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    magnitude.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    for axes in (magnitude, difference):
        axes.set_xlim(pair.frequencies[0], pair.frequencies[-1])
    if outer:
        magnitude.set_ylabel(f"|H| ({unit})")
        difference.set_ylabel("Diff. (%)")
