"""Pictures and tables of a robot: mode shapes, compliance, receptance, maps."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation import Frf
from millfrf.core import Real, write_csv
from millfrf.figures import COLOURS, LINE_STYLES, SHADE, house_style, new_figure, panel_letter
from millfrf.robot_model import (
    CompensatedPath,
    CutPlace,
    DeviationMap,
    PlanarCase,
    PostureMap,
    PostureResult,
    SpatialCase,
    ToolPath,
    close_loops,
    drive_stiffness,
    tool_jacobian,
)


def deviation_figure(deviations: DeviationMap, shape: tuple[int, int], needed: Real, least: str = "") -> Figure:
    """Draw the deviations and the needed position tolerances (n,), m; white where a hole is not reached.

    ``shape``: number of places along x and y; ``least``: ``at least `` if parts of the budget are unknown.
    """
    sizes = 1e3 * np.linalg.norm(deviations.deviations, axis=1)
    fields = [
        (sizes, "deviation under thrust (mm)"),
        (1e3 * needed, f"position tolerance, {least}(mm)" if least else "position tolerance (mm)"),
    ]
    return map_figure(deviations.positions, shape, fields)


def workspace_figure(places: Sequence[CutPlace], shape: tuple[int, int], lowest: Real, limits: Real) -> Figure:
    """Draw lowest frequencies (n,), Hz, and depth limits (n,), m, if there are any; NaN where not reached."""
    fields = [(lowest, "lowest natural frequency (Hz)")]
    if np.isfinite(limits).any():
        fields.append((1e3 * limits, "depth limit (mm)"))
    return map_figure(np.array([place.position for place in places]), shape, fields)


@house_style()
def map_figure(positions: Real, shape: tuple[int, int], fields: Sequence[tuple[Real, str]]) -> Figure:
    """Draw fields (values (n,) and label) over y and x of positions (n, 3), m, with labelled contours."""
    x, y = (positions[:, axis].reshape(shape) for axis in (0, 1))
    tall = float(np.ptp(x)) / max(float(np.ptp(y)), 1e-9)
    figure = new_figure(float(np.clip(150.0 / len(fields) * tall + 18.0, 55.0, 120.0)))
    figure.set_layout_engine("compressed")
    panels = figure.subplots(1, len(fields), squeeze=False)[0]
    for number, (axes, (field, label)) in enumerate(zip(panels, fields, strict=True)):
        shown = np.ma.masked_invalid(field.reshape(shape))
        drawn = axes.pcolormesh(y, x, shown, shading="nearest", cmap="viridis")
        if min(shape) > 2 and shown.count() > 8 and np.ptp(shown.compressed()) > 0:
            lines = axes.contour(y, x, shown, 6, colors="white", linewidths=0.7)
            axes.clabel(lines, fontsize=7)
        figure.colorbar(drawn, ax=axes, label=label, pad=0.02)
        axes.set_xlabel("y (m)")
        axes.set_ylabel("x (m)")
        axes.set_aspect("equal")
        axes.grid(visible=False)
        if len(fields) > 1:
            panel_letter(axes, number)
    return figure


@house_style()
def posture_figure(postures: PostureMap, max_depth: float, depth: float | None, what: str) -> Figure:
    """Draw depth limits (m) and lowest natural frequency over the angle, as Mousavi et al., Fig. 11.

    ``max_depth``: largest depth that was searched, m; ``depth``: a cut whose stable angles are marked, m; ``what``:
    name of the redundancy on the axis.
    """
    angles, limits = np.degrees(postures.angles), 1e3 * postures.values
    figure = new_figure(95.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    top = 1.1 * min(1e3 * max_depth, float(np.nanmax(limits, initial=0.0))) or 1.0
    upper.fill_between(angles, limits, top, color=SHADE, label="unstable")
    upper.plot(angles, limits, color=COLOURS[0], marker="o", markersize=2.5, label="depth limit")
    if depth is not None:
        stable = postures.reached & (postures.values > depth)
        upper.axhline(1e3 * depth, color=COLOURS[2], linestyle="--", label=f"cut of {1e3 * depth:g} mm")
        level = np.full(int(stable.sum()), 1e3 * depth)
        upper.plot(angles[stable], level, "s", color=COLOURS[1], markersize=4, label="stable there")
        chatters = postures.reached & ~stable
        level = np.full(int(chatters.sum()), 1e3 * depth)
        upper.plot(angles[chatters], level, "x", color=COLOURS[2], markersize=4.5, label="chatters there")
    upper.set_ylabel("Depth of cut (mm)")
    upper.set_ylim(0, top)
    lower.plot(angles, postures.frequencies, color=COLOURS[0], marker="o", markersize=2.5)
    lower.set_ylabel("Lowest natural\nfrequency (Hz)")
    lower.set_xlabel(f"Turn of {what} (degrees)")
    lower.set_xlim(angles.min(), angles.max())
    for number, axes in enumerate((upper, lower)):
        panel_letter(axes, number)
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


@house_style()
def compensation_figure(nominal: ToolPath, result: CompensatedPath) -> Figure:
    """Draw the predicted deviation in the base's x, y and z, its length, and the deviation after the correction."""
    steps = np.linalg.norm(np.diff(nominal.positions, axis=0), axis=1)
    way = 1e3 * np.concatenate([[0.0], np.cumsum(steps)])
    figure = new_figure(95.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for i, name in enumerate("xyz"):
        style = {"color": COLOURS[i + 1], "linestyle": LINE_STYLES[i + 1]}
        upper.plot(way, 1e3 * result.deviations[:, i], **style, label=f"in {name}")
    upper.plot(way, 1e3 * np.linalg.norm(result.deviations[:, :3], axis=1), color=COLOURS[0], label="size")
    upper.set_ylabel("Deviation without\ncorrection (mm)")
    left = 1e6 * np.linalg.norm(result.left[:, :3], axis=1)
    lower.plot(way, left, color=COLOURS[0])
    lower.set_ylabel("Left by the\nsame model (µm)")
    lower.set_ylim(bottom=0)
    lower.yaxis.set_major_formatter("{x:g}")  # a factor above the axis would stand on the panel's letter
    lower.set_xlabel("Way along the path (mm)")
    lower.set_xlim(0, max(float(way[-1]), 1e-9))
    for number, axes in enumerate((upper, lower)):
        panel_letter(axes, number)
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


_PLANES = ((0, 1), (0, 2), (1, 2))


def joint_shares(case: PlanarCase | SpatialCase, driven: Real, direction: Real) -> tuple[list[str], Real]:
    """Names of the drives and their compliance in a unit direction of the base: ``(J_j^T d)^2 / k_j``, m/N."""
    if isinstance(case, PlanarCase):
        return [], np.zeros(0)
    mechanism = case.robot.mechanism
    q = close_loops(mechanism, driven)
    arms = tool_jacobian(mechanism, q)[:3].T @ direction
    names = [mechanism.frames[index].name for index in mechanism.moving if mechanism.frames[index].active]
    return names, arms**2 / drive_stiffness(case.robot)


@house_style()
def compliance_figure(result: PostureResult, force: float, shares: tuple[list[str], Real], softest: float) -> Figure:
    """Draw the displacement of the tip under a force (N) that turns in each plane, and the share of each drive.

    ``softest`` is the compliance in the softest direction, m/N; links and bearings give what the drives do not.
    """
    names = [label.split(":")[1].lstrip("+") for label in result.labels]
    moving = [i for i, name in enumerate(names) if "R" not in name]
    compliance = 1e3 * force * result.compliance[np.ix_(moving, moving)]
    planes = [pair for pair in _PLANES if max(pair) < len(moving)]
    angles = np.linspace(0, 2 * np.pi, 181)
    reach = 1.1 * float(np.linalg.norm(compliance, 2))
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
    """Draw the share of each drive, and of links and bearings, in the compliance in the softest direction."""
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


@house_style()
def receptance_figure(frf: Frf, resonances: np.ndarray) -> Figure:
    """Draw direct receptances (m/N) over frequency, in grey the largest cross receptance, and resonances (Hz)."""
    names = [label.split(":")[1].lstrip("+") for label in frf.responses]
    direct = [(name, frf.values[:, i, i]) for i, name in enumerate(names)]
    apart = np.abs(frf.values) * (1 - np.eye(len(names)))
    figure = new_figure(110.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    if len(names) > 1:
        cross = apart.reshape(len(apart), -1).max(axis=1)
        upper.semilogy(frf.frequencies, 1e6 * cross, color="0.65", linewidth=1.0, label="largest across")
    for number, (name, values) in enumerate(direct):
        style = {"color": COLOURS[number], "linestyle": LINE_STYLES[number % len(LINE_STYLES)]}
        upper.semilogy(frf.frequencies, 1e6 * np.abs(values), label=f"{name} under force in {name}", **style)
        lower.plot(frf.frequencies, np.degrees(np.angle(values)), **style)
    shown = resonances[(resonances >= frf.frequencies[0]) & (resonances <= frf.frequencies[-1])]
    for axes in (upper, lower):
        for value in shown:
            axes.axvline(value, color="0.8", linewidth=0.6, zorder=0)
    upper.set_ylabel("Receptance (µm/N)")
    lower.set_ylabel("Phase (degrees)")
    lower.set_ylim(-190, 190)
    lower.set_yticks([-180, -90, 0, 90, 180])
    lower.set_xlabel("Frequency (Hz)")
    lower.set_xlim(frf.frequencies[0], frf.frequencies[-1])
    for number, axes in enumerate((upper, lower)):
        panel_letter(axes, number)
    handles, labels = upper.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def write_receptance_table(path: Path, frf: Frf, warnings: Sequence[str], origin: Mapping[str, Any]) -> None:
    """Write real and imaginary part of each entry as CSV: ``re_X_Y_m_per_n`` is X under a force in Y."""
    names = [
        f"{part}_{response.split(':')[1].lstrip('+')}_{excitation.split(':')[1].lstrip('+')}_m_per_n"
        for response in frf.responses
        for excitation in frf.excitations
        for part in ("re", "im")
    ]
    flat = frf.values.reshape(len(frf.frequencies), -1)
    rows = np.column_stack([frf.frequencies, np.stack([flat.real, flat.imag], axis=2).reshape(len(flat), -1)])
    write_csv(path, ["frequency_hz", *names], rows, warnings=warnings, provenance=origin)


def write_compliance_table(path: Path, result: PostureResult, origin: Mapping[str, Any]) -> None:
    """Write the compliance as CSV: a row for each degree of freedom, a column for each force (N) and moment (N m)."""
    names = [label.split(":")[1].lstrip("+") for label in result.labels]
    columns = ["moves", "unit", *(f"per_{'nm' if 'R' in name else 'n'}_{name}" for name in names)]
    rows = [[name, "rad" if "R" in name else "m", *row] for name, row in zip(names, result.compliance, strict=True)]
    write_csv(path, columns, rows, warnings=result.warnings, provenance=origin)
