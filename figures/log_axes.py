"""Logarithmic axes with few labelled ticks; the small marks between decades are one artist, as every tick is dear."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.markers import TICKRIGHT, TICKUP
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator
from numpy.typing import NDArray

MOST_DECADES = 6
"""Labelled decades; more are labelled in equal steps."""

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain_log_axis(axes: Axes, side: str, low: float, high: float) -> None:
    """Scale one axis logarithmically from ``low`` to ``high``, with plain numbers at 1, 2 and 5 times the decades.

    Parameters
    ----------
    axes
        Axes whose x or y axis is set.
    side
        ``x`` or ``y``.
    low, high
        Ends of the axis, positive.
    """
    axis = _scaled(axes, side, low, high)
    ticks = np.outer(10.0 ** _decades(low, high), (1, 2, 5)).ravel()
    inside = ticks[(ticks >= low) & (ticks <= high)]
    _label(axis, inside, [f"{tick:g}" for tick in inside])


def decade_axis(axes: Axes, side: str, low: float, high: float, label: Callable[[int], str] | None = None) -> None:
    """Scale one axis logarithmically from ``low`` to ``high``, with a number at each decade and small marks between.

    Between less than two decades, plain numbers stand at 1, 2 and 5 times the decades.

    Parameters
    ----------
    axes
        Axes whose x or y axis is set.
    side
        ``x`` or ``y``.
    low, high
        Ends of the axis, positive.
    label
        Gives the words at a power of ten; None: :func:`power_of_ten`.
    """
    powers = _decades(low, high)
    shown = powers[(10.0**powers >= low) & (10.0**powers <= high)]
    if len(shown) < 2:
        plain_log_axis(axes, side, low, high)
        return
    axis = _scaled(axes, side, low, high)
    step = -(-len(shown) // MOST_DECADES)
    labelled = shown[shown % step == 0] if step > 1 else shown
    _label(axis, 10.0**labelled, [(label or power_of_ten)(int(power)) for power in labelled])
    between = 10.0**shown if step > 1 else np.outer(10.0**powers, np.arange(2, 10)).ravel()
    _mark(axes, side, between[(between > low) & (between < high)])


def power_of_ten(power: int) -> str:
    """Ten to a power, with raised digits.

    Examples
    --------
    >>> power_of_ten(-12)
    '10⁻¹²'
    """
    return "10" + str(power).translate(_RAISED)


def _decades(low: float, high: float) -> NDArray[np.float64]:
    """Powers of the decades that hold the range."""
    return np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)


def _scaled(axes: Axes, side: str, low: float, high: float) -> Axis:
    axes.set(**{f"{side}scale": "log", f"{side}lim": (low, high)})
    axis: Axis = getattr(axes, f"{side}axis")
    axis.set_minor_locator(NullLocator())
    return axis


def _label(axis: Axis, ticks: NDArray[np.float64], labels: list[str]) -> None:
    axis.set_major_locator(FixedLocator(ticks.tolist()))
    axis.set_major_formatter(FixedFormatter(labels))


def _mark(axes: Axes, side: str, places: NDArray[np.float64]) -> None:
    """Small marks along the left or lower edge."""
    edge = np.zeros(len(places))
    look: dict[str, Any] = {"linestyle": "none", "color": "black", "markersize": 2.0, "markeredgewidth": 0.5}
    if side == "x":
        marks = Line2D(places, edge, marker=TICKUP, transform=axes.get_xaxis_transform(), **look)
    else:
        marks = Line2D(edge, places, marker=TICKRIGHT, transform=axes.get_yaxis_transform(), **look)
    axes.add_artist(marks)
