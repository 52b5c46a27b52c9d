"""Figure of learning: depth limits with their bands before and after, and the cuts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from millfrf.stability import BandedLimits, ProductionCut

from .cuts import TriedCut, depth_axis_top, draw_limits, draw_tried_cuts
from .style import COLOURS, house_style, legend_above, new_figure


def learned_figure(limits: Mapping[str, BandedLimits], cuts: Sequence[ProductionCut]) -> Figure:
    """Draw limits by name, such as those before and after learning, with their 95 % bands, and the cuts as marks."""
    tried = [TriedCut(cut.spindle_speed * 30 / np.pi, cut.depth, cut.verdict) for cut in cuts]
    deepest = max(each.max_depth for each in limits.values())
    top = min(depth_axis_top([each.lobes for each in limits.values()], tried), 1.05e3 * deepest)
    with house_style():
        figure = new_figure(95.0)
        axes = figure.subplots()
        for number, (label, each) in enumerate(limits.items()):
            rpm, high = each.lobes.spindle_speeds_rpm, np.minimum(1e3 * each.band.high, 1.5 * top)
            shade: dict[str, Any] = {"alpha": 0.2, "linewidth": 0.0, "label": f"95 % band, {label}"}
            axes.fill_between(rpm, 1e3 * each.band.low, high, color=COLOURS[number], **shade)
            draw_limits(axes, each.lobes, label, number)
        draw_tried_cuts(axes, tried)
        axes.set(xlim=(rpm.min(), rpm.max()), ylim=(0, top))
        axes.set(xlabel="Spindle speed (rpm)", ylabel="Depth limit (mm)")
        legend_above(figure, axes, columns=3)
    return figure
