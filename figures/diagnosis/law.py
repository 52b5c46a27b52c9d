"""The measured restoring force of a joint, no law assumed, beside the law that was accepted."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mismatch import BinnedForce, FreeFormLaw

from ..style import COLOURS, SHADE, house_style, legend_above, legend_height, new_figure, panel_letter, place_panels

COLUMNS = 3
"""Columns of the legend, whose labels are long."""


def law_figure(found: FreeFormLaw) -> Figure:
    """Force against deflection, moving forth and back, and against velocity with what depends on deflection taken off.

    Symbols are means in bins with bands of two standard errors; lines are the accepted law driven by the same motion
    and averaged alike. Where the accepted law has a free form, dotted lines are the library's.
    """
    law = found.name.replace("_", " ")
    freed = found.forward.textbook is not None
    rising, falling = (law.capitalize(), "Free form") if freed else (f"Law ({law})", "Law")
    with house_style():
        figure = new_figure(82.0, None)
        left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.24})
        _draw(left, found.forward, ("o", COLOURS[0]), "Measured, deflection rising", (f"{rising}, rising", "-"), 1e6)
        lines = f"{falling}, falling", (0, (5, 1.5))
        _draw(left, found.backward, ("v", COLOURS[2]), "Measured, falling", lines, 1e6)
        _draw(right, found.damping, ("o", COLOURS[0]), "", ("", "-"), 1e3)
        left.set_xlabel(f"Deflection along the joint (µ{found.deflection_unit})")
        right.set_xlabel(f"Velocity along the joint (m{found.deflection_unit}/s)")
        left.set_ylabel(f"Force beyond the linear model ({found.force_unit})")
        right.set_ylabel(f"Force less its mean at that deflection ({found.force_unit})")
        _same_scale(left, right, (found.forward, found.backward, found.damping))
        for number, axes in enumerate((left, right)):
            axes.axhline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.axvline(0, color="#999999", linewidth=0.5, zorder=1)
            axes.locator_params(axis="x", nbins=6)
            panel_letter(axes, number)
        place_panels(figure, left=17.0, top=legend_height(left, COLUMNS) + 5.0)
        legend_above(figure, left, COLUMNS)
    return figure


def _draw(
    axes: Axes,
    bins: BinnedForce,
    marks: tuple[str, str],
    label: str,
    law: tuple[str, str | tuple[int, tuple[float, ...]]],
    scale: float,
) -> None:
    at = scale * bins.at
    axes.fill_between(at, bins.force - 2 * bins.error, bins.force + 2 * bins.error, color=SHADE, linewidth=0, zorder=1)
    axes.plot(at, bins.law, color=marks[1], linestyle=law[1], linewidth=1.0, label=law[0] or None)
    if bins.textbook is not None:
        axes.plot(at, bins.textbook, color=marks[1], linestyle=":", linewidth=1.2, label=law[0] and "Textbook law")
    filled = "white" if marks[0] == "o" else marks[1]
    axes.plot(
        at, bins.force, marks[0], color=marks[1], markerfacecolor=filled, markersize=3.8, label=label or None, zorder=3
    )


def _same_scale(left: Axes, right: Axes, all_bins: tuple[BinnedForce, ...]) -> None:
    values: NDArray[np.float64] = np.concatenate(
        [np.maximum(np.abs(one.force) + 2 * one.error, np.abs(one.law)) for one in all_bins]
    )
    top = 1.1 * float(np.max(values))
    left.set_ylim(-top, top)
    right.set_ylim(-top, top)
