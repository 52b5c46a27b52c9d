"""Figure of learning: depth limits with their bands before and after, and the cuts."""

import numpy as np
from matplotlib.figure import Figure

from millfrf.stability import Learned, LearnedLimits

from .cuts import TriedCut, depth_axis_top, draw_limits, draw_tried_cuts
from .style import COLOURS, house_style, legend_above, new_figure


def learned_figure(limits: LearnedLimits, learned: Learned) -> Figure:
    """Draw limits before and after learning with their 95 % bands, and the cuts as marks.

    Where cuts contradict the model, only the limits before are drawn.
    """
    shown = [("before", limits.before, limits.band_before)]
    if not learned.contradictions:
        shown.append(("learned", limits.after, limits.band_after))
    cuts = [TriedCut(cut.spindle_speed * 30 / np.pi, cut.depth, cut.verdict) for cut in learned.conclusive]
    top = min(depth_axis_top([lobes for _, lobes, _ in shown], cuts), 1.05e3 * limits.max_depth)
    with house_style():
        figure = new_figure(95.0)
        axes = figure.subplots()
        for number, (label, lobes, band) in enumerate(shown):
            high = np.minimum(1e3 * band.high, 1.5 * top)
            look = {"alpha": 0.25, "linewidth": 0.0, "label": f"95 % band, {label}"}
            axes.fill_between(lobes.spindle_speeds_rpm, 1e3 * band.low, high, color=COLOURS[number], **look)
            draw_limits(axes, lobes, label, number)
        draw_tried_cuts(axes, cuts)
        axes.set(ylim=(0, top), xlabel="Spindle speed (rpm)", ylabel="Depth limit (mm)")
        legend_above(figure, axes, columns=3)
    return figure
