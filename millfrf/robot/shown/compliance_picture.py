"""Compliance of a posture as a picture: how far the tip goes in each direction, and which joint gives way."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from millfrf.figures import COLOURS, house_style, new_figure, panel_letter
from millfrf.robot_model import PlanarCase, PostureResult, SpatialCase, close_loops, drive_stiffness, tool_jacobian

Real = NDArray[np.float64]

_PLANES = ((0, 1), (0, 2), (1, 2))


def joint_shares(case: PlanarCase | SpatialCase, driven: Real, direction: Real) -> tuple[list[str], Real]:
    """Compliance in a direction that each drive gives: ``(J_j^T d)^2 / k_j``, m/N; names and values.

    Parameters
    ----------
    direction : (3,)
        Unit vector in the base frame.
    """
    if isinstance(case, PlanarCase):
        return [], np.zeros(0)
    mechanism = case.robot.mechanism
    q = close_loops(mechanism, driven)
    arms = tool_jacobian(mechanism, q)[:3].T @ direction
    names = [mechanism.frames[index].name for index in mechanism.moving if mechanism.frames[index].active]
    return names, arms**2 / drive_stiffness(case.robot)


def compliance_figure(result: PostureResult, force: float, shares: tuple[list[str], Real], softest: float) -> Figure:
    """Draw the displacement of the tip under a force that turns in each plane, and the share of each drive.

    Parameters
    ----------
    result
        Result of the posture.
    force : N
        Force that turns.
    shares
        Names of the drives and their compliance in the softest direction, m/N; empty: left out.
    softest : m/N
        Compliance in the softest direction; what the drives leave of it are links and bearings.
    """
    names = [label.split(":")[1].lstrip("+") for label in result.labels]
    moving = [i for i, name in enumerate(names) if "R" not in name]
    compliance = 1e3 * force * result.compliance[np.ix_(moving, moving)]
    planes = [pair for pair in _PLANES if max(pair) < len(moving)]
    angles = np.linspace(0, 2 * np.pi, 181)
    reach = 1.1 * float(np.linalg.norm(compliance, 2))
    with house_style():
        figure = new_figure(105.0 if shares[0] else 70.0)
        grid = figure.add_gridspec(2 if shares[0] else 1, len(planes), height_ratios=[1.5, 1] if shares[0] else [1])
        for column, (first, second) in enumerate(planes):
            axes = figure.add_subplot(grid[0, column])
            along = np.zeros((len(moving), len(angles)))
            along[first], along[second] = np.cos(angles), np.sin(angles)
            moved = compliance @ along
            axes.plot(moved[first], moved[second], color=COLOURS[1])
            for point in range(0, 180, 15):
                ends = [[0, moved[axis, point]] for axis in (first, second)]
                axes.plot(*ends, color="0.75", linewidth=0.6)
            axes.set_xlim(-reach, reach)
            axes.set_ylim(-reach, reach)
            axes.set_aspect("equal")
            axes.set_xlabel(f"{names[moving[first]]} (mm)")
            axes.set_ylabel(f"{names[moving[second]]} (mm)")
            panel_letter(axes, column)
        if shares[0]:
            _bars(figure.add_subplot(grid[1, :]), shares, softest)
        figure.suptitle(f"Displacement of the tool tip under {force:g} N in every direction", fontsize=9)
    return figure


def _bars(axes: Axes, shares: tuple[list[str], Real], softest: float) -> None:
    """Share of each drive in the softest direction, and what links and bearings add."""
    names, values = shares
    percent = [*(100 * values / softest), max(100 * (1 - float(values.sum()) / softest), 0.0)]
    labels = [*names, "links,\nbearings"]
    places = np.arange(len(labels))
    axes.bar(places, percent, color=COLOURS[1], width=0.6)
    for place, value in zip(places, percent, strict=True):
        axes.annotate(f"{value:.0f}", (place, value), ha="center", va="bottom")
    short = [label if len(label) < 12 else label.replace("_", "\n") for label in labels]
    axes.set_xticks(places, short)
    axes.set_ylabel("Share in the softest\ndirection (%)")
    axes.set_ylim(0, 1.2 * max(percent))
    panel_letter(axes, 3)
