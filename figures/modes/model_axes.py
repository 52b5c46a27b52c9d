"""A modal model drawn into axes: the FRF that it gives, with its natural frequencies marked."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..axes import given_or_new
from ..measurement import draw_frf
from ..style import FITTED

LINES = 1001
"""Frequencies at which a model is drawn."""


def draw_model(
    model: ModalModel,
    axes: Axes | None = None,
    *,
    frequencies: NDArray[np.float64] | None = None,
    response: str | None = None,
    excitation: str | None = None,
    part: str = "magnitude",
    quantity: str | None = None,
    **line: Any,
) -> Axes:
    """Entries of the FRF that a model gives; thin vertical lines stand at its natural frequencies.

    Parameters
    ----------
    model
        Modal model of any quantity.
    axes
        To draw into, such as those of a measured FRF; None: new ones.
    frequencies : (n_frequencies,), Hz
        None: those that the given axes show, else the model's band, else from half the lowest natural frequency to one
        and a half times the highest.
    response, excitation, part, quantity, line
        As in :func:`figures.draw_frf`.

    Raises
    ------
    InputError
        A degree of freedom or a part that is not there.
    """
    grid = _grid(model, axes) if frequencies is None else np.asarray(frequencies, dtype=float)
    drawn_over = axes is not None and axes.has_data()
    look = {"linestyle": (0, (5, 1.5)), "color": FITTED, "linewidth": 1.4, "label": "model"} if drawn_over else {}
    with given_or_new(axes) as shown:
        for number, frequency in enumerate(model.natural_frequencies):
            label = "natural frequencies" if number == 0 and not drawn_over else None
            shown.axvline(frequency, color="#777777", linewidth=0.7, linestyle=(0, (1, 1.5)), label=label, zorder=1)
        style = {**look, **line}
        draw_frf(
            model.frf(grid), shown, response=response, excitation=excitation, part=part, quantity=quantity, **style
        )
        if axes is None:
            shown.set_xlim(grid[0], grid[-1])
    return shown


def _grid(model: ModalModel, axes: Axes | None) -> NDArray[np.float64]:
    """Frequencies in Hz; none at 0, where a residual inertia is infinite."""
    if axes is not None and axes.has_data():
        low, high = axes.get_xlim()
    elif model.band is not None:
        low, high = model.band
    else:
        natural = model.natural_frequencies if len(model.poles) else np.array([1.0])
        low, high = 0.5 * float(natural.min()), 1.5 * float(natural.max())
    return np.linspace(max(low, 1e-3 * high), high, LINES)
