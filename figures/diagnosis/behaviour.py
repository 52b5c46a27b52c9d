"""Natural frequency and damping ratio of modes over the level of excitation."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from mismatch import Behaviour, ModeTrend

from ..style import COLOURS, LINE_STYLES, house_style, new_figure, panel_letter

MOST = 6
"""Modes that are drawn: those that move most clearly."""

MARKS = "osD^vP"
ASIDE = 0.012
"""Distance between modes at one level, as a share of it, so that bars do not cover each other."""


def behaviour_figure(behaviour: Behaviour) -> Figure:
    """Change of natural frequency, and damping ratio, of each mode over the level, with two standard errors.

    Parameters
    ----------
    behaviour
        Behaviour at two levels at least.
    """
    chosen = sorted(behaviour.modes, key=_clearness)[-MOST:]
    modes = sorted(chosen, key=lambda one: one.frequencies[0])
    with house_style():
        figure = new_figure(75.0)
        panels = figure.subplots(1, 2)
        panels[0].axhline(0, color="#808080", linewidth=0.8)
        for number, mode in enumerate(modes):
            _draw(panels, mode, number, number - (len(modes) - 1) / 2)
        panels[0].set_ylabel("Natural frequency, change (%)")
        panels[1].set_ylabel("Damping ratio (%)")
        panels[1].set_ylim(bottom=0)
        name = "Force" if behaviour.unit == "N" else "Drive"
        for number, axes in enumerate(panels):
            panel_letter(axes, number)
            axes.set_xscale("log")
            levels = modes[0].levels
            axes.set_xticks(levels, [f"{level:.3g}" for level in levels])
            axes.xaxis.set_minor_locator(NullLocator())
            axes.set_xlabel(f"{name}, root mean square ({behaviour.unit})")
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=min(len(modes), 6))
    return figure


def _clearness(mode: ModeTrend) -> float:
    return max(abs(mode.shift) / max(mode.shift_error, 1e-12), abs(mode.gain) / max(mode.gain_error, 1e-12))


def _draw(panels: "np.ndarray[tuple[int], np.dtype[np.object_]]", mode: ModeTrend, number: int, place: float) -> None:
    """One mode in both panels."""
    at = np.array(mode.levels) * (1 + ASIDE * place)
    first = mode.frequencies[0]
    rows = (
        (100 * (np.array(mode.frequencies) / first - 1), 200 * np.array(mode.frequency_errors) / first),
        (100 * np.array(mode.damping), 200 * np.array(mode.damping_errors)),
    )
    axes: Axes
    for axes, (values, errors) in zip(panels, rows, strict=True):
        axes.errorbar(
            at,
            values,
            errors,
            color=COLOURS[number],
            linestyle=LINE_STYLES[number],
            marker=MARKS[number],
            markersize=4,
            markerfacecolor="white" if number % 2 else COLOURS[number],
            capsize=2,
            label=f"{first:.3g} Hz",
        )
