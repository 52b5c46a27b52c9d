"""Picture of the posture model: the bands of poses that were left out, and what was measured there."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.figures import COLOURS, house_style, new_figure, panel_letter

from .coverage import PostureCoverage

NAMES = 24
"""Names of poses that are written under the axis at most."""


def draw_coverage(coverage: PostureCoverage) -> Figure:
    """Draw bands as grey bars about their middle, and measured values as marks, filled where the band holds them.

    Parameters
    ----------
    coverage
        Poses that were left out in turn.
    """
    with house_style():
        figure = new_figure(112.0)
        axes = figure.subplots(2, 1, sharex=True)
        for k, quantity in enumerate(("natural frequency", "damping ratio")):
            _panel(axes[k], coverage, k)
            panel_letter(axes[k], k)
            axes[k].set_ylabel(f"{quantity}:\nfrom the middle of the band (%)")
        poses = list(dict.fromkeys(coverage.poses))
        shown = list(range(0, len(poses), max(1, -(-len(poses) // NAMES))))
        axes[1].set_xticks(shown, [poses[k] for k in shown], rotation=60 if len(poses) > 10 else 0)
        axes[1].set_xlabel("pose that was left out (modes from left to right, by frequency)")
        axes[1].set_xlim(-0.6, len(poses) - 0.4)
    return figure


def _panel(axes: Axes, coverage: PostureCoverage, quantity: int) -> None:
    poses = list(dict.fromkeys(coverage.poses))
    for one, pose in zip(coverage.left_out, coverage.poses, strict=True):
        count = len(one.measured)
        order = np.argsort(one.measured[:, 0], kind="stable")
        at = poses.index(pose) + 0.7 * ((np.arange(count) + 0.5) / max(count, 1) - 0.5)
        low, high = one.low[order, quantity], one.high[order, quantity]
        middle = np.sqrt(low * high)
        axes.vlines(at, 100 * (low / middle - 1), 100 * (high / middle - 1), color="0.78", linewidth=3.2, zorder=1)
        value, held = 100 * (one.measured[order, quantity] / middle - 1), one.held[order, quantity]
        axes.plot(at[held], value[held], "o", color="black", markersize=2.6, zorder=2)
        axes.plot(at[~held], value[~held], "X", color=COLOURS[2], markersize=5.0, zorder=3)
    axes.axhline(0.0, color="0.6", linewidth=0.6, zorder=0)
    axes.grid(False, axis="x")
