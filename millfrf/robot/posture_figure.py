"""Depth limit over a redundancy angle as a picture: which postures keep a cut stable."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from millfrf.figures import COLOURS, SHADE, house_style, new_figure, panel_letter, save_figure
from millfrf.robot_model import PostureMap


def draw_posture_map(path: Path, found: PostureMap, max_depth: float, depth: float | None, what: str) -> None:
    """Write :func:`posture_figure` as ``.png``, ``.pdf`` or ``.svg``."""
    with house_style():
        figure = posture_figure(found, max_depth, depth, what)
    save_figure(figure, path)


def posture_figure(found: PostureMap, max_depth: float, depth: float | None, what: str) -> Figure:
    """Draw largest stable depth and lowest natural frequency over the angle, as Mousavi et al., Fig. 11.

    Parameters
    ----------
    found
        Posture map whose values are depth limits, m.
    max_depth : m
        Largest depth that was searched: limits at it lie beyond.
    depth : m
        Depth of a cut whose stable angles are marked; or None.
    what
        Words for the redundancy, for the axis: ``tool and table about the feed``.
    """
    angles, limits = np.degrees(found.angles), 1e3 * found.values
    figure = new_figure(95.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    top = 1.1 * min(1e3 * max_depth, float(np.nanmax(limits, initial=0.0))) or 1.0
    upper.fill_between(angles, limits, top, color=SHADE, label="unstable")
    upper.plot(angles, limits, color=COLOURS[0], marker="o", markersize=2.5, label="depth limit")
    if depth is not None:
        stable = found.reached & (found.values > depth)
        upper.axhline(1e3 * depth, color=COLOURS[2], linestyle="--", label=f"cut of {1e3 * depth:g} mm")
        level = np.full(int(stable.sum()), 1e3 * depth)
        upper.plot(angles[stable], level, "s", color=COLOURS[1], markersize=4, label="stable there")
        chatters = found.reached & ~stable
        level = np.full(int(chatters.sum()), 1e3 * depth)
        upper.plot(angles[chatters], level, "x", color=COLOURS[2], markersize=4.5, label="chatters there")
    upper.set_ylabel("Depth of cut (mm)")
    upper.set_ylim(0, top)
    lower.plot(angles, found.frequencies, color=COLOURS[0], marker="o", markersize=2.5)
    lower.set_ylabel("Lowest natural\nfrequency (Hz)")
    lower.set_xlabel(f"Turn of {what} (degrees)")
    lower.set_xlim(angles.min(), angles.max())
    for number, axes in enumerate((upper, lower)):
        panel_letter(axes, number)
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure
