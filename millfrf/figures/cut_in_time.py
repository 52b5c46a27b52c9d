"""Figures of forced vibration: a simulated cut over time, and the error of the wall over spindle speed."""

import numpy as np
from matplotlib.figure import Figure

from millfrf.stability import SimulatedCut, SurfaceError

from .style import COLOURS, SHADE, house_style, legend_above, new_figure, panel_letter

LAST_TURNS = 3  # turns that are drawn in detail


def simulated_figure(cut: SimulatedCut) -> Figure:
    """Draw the motion of the whole cut, and motion, force and chip in its last turns."""
    last = slice(-LAST_TURNS * cut.steps, None)
    turned = np.arange(1, len(cut.times) + 1) / cut.steps
    with house_style():
        figure = new_figure(150.0)
        panels = figure.subplots(4, 1)
        for axes, part in zip(panels[:2], (slice(None), last), strict=True):
            for axis in range(3):
                if cut.motion[:, axis].any():
                    axes.plot(turned[part], 1e6 * cut.motion[part, axis], color=COLOURS[axis], label="XYZ"[axis])
            axes.set_ylabel("Motion (µm)")
        for axis in range(3):
            panels[2].plot(turned[last], cut.force[last, axis], color=COLOURS[axis])
        panels[2].set_ylabel("Force (N)")
        panels[3].plot(turned[last], 1e6 * cut.chip[last], color="black")
        panels[3].set_ylabel("Thickest chip (µm)")
        panels[3].set_xlabel("Turns of the spindle")
        for number, axes in enumerate(panels):
            span = turned if number == 0 else turned[last]
            axes.set_xlim(float(span[0]), float(span[-1]))
            panel_letter(axes, number)
        panels[0].set_title(_verdict(cut))
        legend_above(figure, panels[0])
    return figure


def _verdict(cut: SimulatedCut) -> str:
    if np.isinf(cut.unsteadiness):
        return "Not stable: the tool moves by more than its radius"
    word = "Stable" if cut.repeats else "Not stable"
    return f"{word}: {100 * cut.unsteadiness:.3g} % of the motion does not repeat in the last quarter"


def wall_figure(result: SurfaceError) -> Figure:
    """Draw the error of the wall over speed, from the smallest to the largest over its height.

    Speeds at which the cut is not stable are shaded; there the error has no meaning and is not drawn.
    """
    rpm = result.spindle_speeds * 30 / np.pi
    stable = np.ones(len(rpm), dtype=bool) if result.stable is None else result.stable
    low, high = (1e6 * np.where(stable, f(result.error, axis=1), np.nan) for f in (np.min, np.max))
    with house_style():
        figure = new_figure(85.0)
        error, share = figure.subplots(2, 1, sharex=True, height_ratios=[2.5, 1.0])
        error.axhline(0.0, color="0.5", linewidth=0.8)
        error.fill_between(rpm, low, high, color=COLOURS[0], alpha=0.3, linewidth=0)
        error.plot(rpm, high, color=COLOURS[0], label="highest over the wall")
        error.plot(rpm, low, color=COLOURS[0], linestyle="--", label="lowest")
        if not stable.all():
            bottom, top = error.get_ylim()
            error.fill_between(
                rpm, bottom, top, where=~stable, color=SHADE, step="mid", linewidth=0, label="not stable"
            )
            error.set_ylim(bottom, top)
        error.set_ylabel("Error of the wall (µm)")
        error.set_title(
            f"{result.wall.capitalize()} milling, {1e3 * result.depth:g} mm deep; above 0: too much removed"
        )
        share.plot(rpm, 100 * result.unmeasured, color="black")
        share.set_ylim(0, None)
        share.set_ylabel("Motion outside the\nmeasured band (%)")
        share.set_xlabel("Spindle speed (rpm)")
        share.set_xlim(float(rpm[0]), float(rpm[-1]))
        for number, axes in enumerate((error, share)):
            panel_letter(axes, number)
        legend_above(figure, error)
    return figure
