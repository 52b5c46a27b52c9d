"""Table, picture and sentences of an optimised path."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.figures import COLOURS, LINE_STYLES, SHADE, house_style, new_figure, panel_letter
from millfrf.robot_model import CutPath, Mechanism, typed_values

from .optimum import PathOptimum
from .search import PathGoal
from .state import PathState


@house_style()
def path_figure(cut: CutPath, before: PathState, after: PathState, max_depth: float, planned: float | None) -> Figure:
    """Draw depth limits, deviation, margins and angles along the path; depths searched and planned in m."""
    way = 1e3 * cut.lengths
    figure = new_figure(165.0)
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.6, 1.2, 1.0, 1.0))
    _depths(panels[0], way, before, after, max_depth, planned)
    for state, look, name in ((before, 0, "redundancy at zero"), (after, 1, "chosen")):
        style = {"color": COLOURS[look], "linestyle": LINE_STYLES[1 - look]}
        panels[1].plot(way, 1e3 * state.sizes, **style, label=name)
        panels[2].plot(way, np.degrees(state.margin), **style)
    panels[1].set_ylabel("Deviation (mm)")
    panels[1].set_ylim(bottom=0)
    panels[2].set_ylabel("Distance to joint\nlimit (degrees)")
    panels[2].set_ylim(bottom=0)
    panels[3].plot(way, np.degrees(after.tool), color=COLOURS[1], label="about the tool")
    if np.ptp(after.table) > 0 or after.table.any():
        panels[3].plot(way, np.degrees(after.table), color=COLOURS[2], linestyle=LINE_STYLES[2], label="rotary table")
        panels[3].legend(loc="best")
    panels[3].set_ylabel("Turn (degrees)")
    panels[3].set_xlabel("Way along the path (mm)")
    panels[3].set_xlim(way.min(), way.max())
    for number, axes in enumerate(panels):
        panel_letter(axes, number)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _depths(
    axes: Axes, way: np.ndarray, before: PathState, after: PathState, max_depth: float, planned: float | None
) -> None:
    limits = [1e3 * state.values.known_depth(max_depth) for state in (before, after)]
    limits[0] = np.where(before.reached, limits[0], np.nan)
    highest = float(max(np.nanmax(limit, initial=0.0) for limit in limits))
    top = 1.15 * min(1e3 * max_depth, highest) or 1.0
    limited = limits[1] < 1e3 * max_depth
    axes.fill_between(way, limits[1], top, where=limited, color=SHADE, label="unstable in the chosen postures")
    axes.plot(way, limits[0], color=COLOURS[0], linestyle=LINE_STYLES[1], label="limit, redundancy at zero")
    axes.plot(way, limits[1], color=COLOURS[1], label="limit, chosen postures")
    unverified = np.array([word != "verified" for word in after.values.status])
    if unverified.any():
        axes.plot(way[unverified], limits[1][unverified], "x", color=COLOURS[2], markersize=4, label="not verified")
    if planned is not None:
        axes.axhline(1e3 * planned, color=COLOURS[2], linestyle=LINE_STYLES[2], label=f"planned, {1e3 * planned:g} mm")
    if not limited.all():
        axes.axhline(1e3 * max_depth, color=COLOURS[3], linestyle=LINE_STYLES[3], label="searched up to here")
    axes.set_ylabel("Depth of cut (mm)")
    axes.set_ylim(0, top)


PLACE = ("point", "x_m", "y_m", "z_m", "i", "j", "k")
CUT = (
    "depth_limit_m",
    "status",
    "bifurcation",
    "chatter_frequency_hz",
    "lowest_frequency_hz",
    "deviation_along_m",
    "deviation_across_m",
    "deviation_axial_m",
)
POSTURE = ("limit_margin_deg", "smallest_singular_value", "jacobian_condition", "tool_turn_deg", "table_turn_deg")


def columns(n_joints: int) -> tuple[str, ...]:
    """Names of the columns: the chosen postures, then the same with ``before_`` for the path as it was given."""
    joints = tuple(f"q{i + 1}" for i in range(n_joints))
    return (*PLACE, *joints, *CUT, *POSTURE, *(f"before_{name}" for name in (*joints, *CUT, *POSTURE[:3])))


def path_table(
    mechanism: Mechanism, before: PathState, after: PathState, max_depth: float
) -> tuple[tuple[str, ...], list[list[object]]]:
    """Return headings and rows of the table of a path.

    ``i j k`` points from the tip to the spindle. Joint values are in degrees, prismatic ones in metres. A depth limit
    above the largest depth searched is written as that depth with the bifurcation ``none``; empty cells are points
    that are not reached or limits that are not known.
    """
    rows: list[list[object]] = []
    for k in range(len(after.q)):
        place = [k + 1, *after.positions[k], *-after.attitudes[k][:, 2]]
        chosen = [*_joints(mechanism, after, k), *_cut(after, k, max_depth), *_posture(after, k)]
        unturned = [*_joints(mechanism, before, k), *_cut(before, k, max_depth), *_posture(before, k)[:3]]
        rows.append([*place, *chosen, *unturned])
    return columns(int(mechanism.active.sum())), rows


def _joints(mechanism: Mechanism, state: PathState, k: int) -> list[float]:
    return [float(value) for value in typed_values(mechanism, state.q[k][mechanism.active])]


def _cut(state: PathState, k: int, max_depth: float) -> list[object]:
    values = state.values
    depth = float(np.minimum(values.depth[k], max_depth))
    return [depth, values.status[k], values.kind[k], values.frequency[k], values.lowest[k], *state.deviation[k]]


def _posture(state: PathState, k: int) -> list[float]:
    angles = np.degrees([state.tool[k], state.table[k]])
    return [float(np.degrees(state.margin[k])), float(state.smallest[k]), float(state.condition[k]), *angles]


def summary(optimum: PathOptimum, goal: PathGoal, max_depth: float, planned: float | None) -> list[str]:
    """Depth, deviation and motion before and after, one line each."""
    lines = []
    for name, state in (("redundancy at zero", optimum.before), ("chosen postures", optimum.after)):
        lines.append(f"{name}: {_state(state, max_depth)}")
    steps = np.degrees(np.abs(np.diff(optimum.after.q, axis=0)).max(initial=0.0))
    margin = np.degrees(optimum.after.margin.min())
    lines.append(
        f"largest joint step {steps:.1f} deg; nearest joint limit {margin:.1f} deg away, "
        f"smallest singular value {optimum.after.smallest.min():.3f}"
    )
    lines.append(f"{optimum.evaluated[1]} postures certified; {'; '.join(optimum.rounds)}")
    if goal.objective == "both":
        lines += [
            f"front: {1e3 * point.depth:.3g} mm deep with {1e3 * point.deviation:.3g} mm of deviation"
            for point in optimum.front
        ]
        lines.append(
            f"chosen on it: smallest {goal.balance:g} x lost depth + {1 - goal.balance:g} x deviation, both scaled"
        )
    if planned is not None:
        proven = optimum.after.values.known_depth(max_depth)
        stable = int((proven >= planned).sum())
        lines.append(f"the planned {1e3 * planned:g} mm is below the limit at {stable} of {len(proven)} points")
    return lines


def _state(state: PathState, max_depth: float) -> str:
    reached = state.reached
    if not reached.any():
        return "no point is reached"
    depth = state.values.known_depth(max_depth)[reached]
    beyond = "at least " if depth.min() >= max_depth else ""
    missed = f"; {int((~reached).sum())} of {len(reached)} points not reached" if not reached.all() else ""
    return (
        f"depth limit {beyond}{1e3 * depth.min():.3g} mm at the worst point, {1e3 * depth.mean():.3g} mm on average; "
        f"deviation up to {1e3 * np.nanmax(state.sizes):.3g} mm{missed}"
    )


def path_warnings(optimum: PathOptimum, path: CutPath) -> list[str]:
    """Warnings about limits, modes that were left out, and plunging."""
    lines = []
    status = optimum.after.values.status
    unverified = [k + 1 for k, word in enumerate(status) if word != "verified"]
    if unverified:
        lines.append(
            f"at {len(unverified)} of {len(status)} points the limit is not verified ({_few(unverified)}): see status"
        )
    lines += plunge_warnings(path)
    kept = optimum.kept
    if np.isfinite(kept.highest_frequency) and kept.highest_frequency < kept.reference:
        lines.append(
            f"modes above {kept.highest_frequency:.0f} Hz are replaced by their static flexibility; with modes "
            f"{_up_to(kept.reference)} the limits at {kept.checked} postures change by at most "
            f"{100 * kept.change:.2g} %"
        )
    return lines


def plunge_warnings(path: CutPath) -> list[str]:
    """Return a warning on the points at which the tool moves along its own axis."""
    plunged = [int(k) + 1 for k in np.flatnonzero(path.plunges)]
    if not plunged:
        return []
    return [
        f"at points {_few(plunged)} the tool moves along its own axis: depth limits there are those of a cut that "
        "feeds as at the nearest other point, not of plunging"
    ]


def _few(points: Sequence[int]) -> str:
    shown = ", ".join(str(point) for point in points[:5])
    return shown if len(points) <= 5 else f"{shown} and {len(points) - 5} more"


def _up_to(frequency: float) -> str:
    return f"up to {frequency:.0f} Hz" if np.isfinite(frequency) else "of all frequencies"
