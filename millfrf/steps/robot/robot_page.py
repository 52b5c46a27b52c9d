"""Step ``robot show``: page with a robot in a posture."""

import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from millfrf.core import InputError, Real, free_name, writing_whole_file
from millfrf.core.provenance import versions
from millfrf.core.steps import File, Writes, step
from millfrf.core.terminal import Table, say_written, warn
from millfrf.figures import COLOURS, MovingShapes, house_style, new_figure
from millfrf.reports.results_page import ResultsPage, page_text
from millfrf.reports.section import Section, picture_of
from millfrf.robot_model import (
    PostureResult,
    SpatialCase,
    StructureModes,
    close_loops,
    in_posture,
    modes_at,
    read_robot,
    shown_values,
    structure_at,
)

from ..given import At, Degrees, Joints, Pose, Robot, Turning
from .postures import cut_place, posture_of, spatial

_SHOWN = 0.25  # largest displacement drawn, m

_REST = "0.78"  # grey of the robot at rest


@step
def show_robot(
    robot: Robot,
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".html",))] = None,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Degrees = 0.0,
    turn: Degrees = 0.0,
    redundancy: Turning = "tool",
    browser: bool = False,
) -> Path:
    """Page with the robot, its joints, its posture and its mode shapes: one file that needs no network.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    out
        Page to write; without it robot.html, or robot-2.html and so on where that exists.
    pose
        Posture named in the robot's file; without it the first one.
    joints : deg
        Values of the driven joints; of prismatic joints in metres.
    at : m
        Place of the tip of a vertical tool, instead of a posture.
    feed : deg
        Direction of the feed from the base's x, with --at.
    turn : deg
        Turn of the redundancy, with --at.
    redundancy
        What turns, with --at: the robot about the tool's axis (tool), or tool and workpiece about the feed (table).
    browser
        Open the page in the browser.

    Returns
    -------
    Path
        Name of the page.

    Raises
    ------
    InputError
        A planar robot, a posture that it does not reach, or no browser.

    Examples
    --------
    ::

        $ millfrf robot show kuka_kr90_r3100 --at 2.0 0 0.8 --out robot.html
    """
    page = free_name(Path("robot.html")) if out is None else Path(out)
    case = spatial(read_robot(robot))
    driven, axes = posture_of(case, pose, joints, cut_place(at, feed, turn, redundancy))
    q = close_loops(case.robot.mechanism, driven)
    result = in_posture(case, driven, axes)
    structure = structure_at(case.robot, q)
    empty = StructureModes(structure, np.zeros(0), np.zeros((0, len(structure.positions), 6)))
    modes = modes_at(case.robot, q) if len(result.frequencies) else empty
    tables = (_joint_table(case, q), _posture_table(case, driven, q, result))
    with writing_whole_file(page) as unfinished:
        unfinished.write_text(mode_page(case.name, modes, tables, result.warnings), encoding="utf-8")
    if browser and not webbrowser.open(page.resolve().as_uri()):
        raise InputError(f"no browser was found; open {page} in one")
    warn(result.warnings)
    say_written([page], "open it in a browser")
    return page


def skeleton(modes: StructureModes) -> list[tuple[int, int]]:
    """Pairs of nodes that a line joins: beams and rigid links."""
    return [*(beam.nodes for beam in modes.structure.beams), *modes.structure.rigid]


def exaggeration(modes: StructureModes, mode: int) -> float:
    """Factor that makes the largest displacement of a mode 0.25 m."""
    return float(_SHOWN / max(np.linalg.norm(modes.shapes[mode, :, :3], axis=1).max(), 1e-300))


@house_style()
def robot_figure(modes: StructureModes, n_modes: int = 4) -> Figure:
    """Draw the robot at rest in grey and its lowest mode shapes in colour, largest displacement 0.25 m.

    The upper row is seen from the front left, the lower row from above, so that lateral motion shows in one of them.
    """
    figure = new_figure(105.0, layout=None)
    shown = min(n_modes, len(modes.squares))
    for mode in range(shown):
        moved = modes.structure.positions + exaggeration(modes, mode) * modes.shapes[mode, :, :3]
        left, width = 0.04 + mode * 0.95 / shown, 0.95 / shown
        upper = figure.add_axes((left, 0.42, width, 0.55), projection="3d")
        _lines(upper, modes, modes.structure.positions, _REST, 3.0)
        _lines(upper, modes, moved, COLOURS[1], 1.3)
        _equal_axes(upper, modes.structure.positions)
        title = f"mode {mode + 1}, {modes.frequencies[mode]:.1f} Hz"
        figure.text(left + 0.5 * width, 0.98, title, ha="center", va="top")
        lower = figure.add_axes((left + 0.03, 0.11, width - 0.05, 0.30))
        _from_above(lower, modes, moved)
        if mode == 0:
            lower.set_ylabel("y (m)")
    return figure


def _from_above(axes: Axes, modes: StructureModes, moved: Real) -> None:
    """Draw a mode shape from above, x to the right."""
    for positions, colour, width in ((modes.structure.positions, _REST, 3.0), (moved, COLOURS[1], 1.3)):
        for first, second in skeleton(modes):
            axes.plot(*positions[[first, second]][:, :2].T, color=colour, linewidth=width, marker="o", markersize=2)
    rest = modes.structure.positions
    middle = (rest.max(axis=0) + rest.min(axis=0)) / 2
    half = max(float(np.ptp(rest[:, :2], axis=0).max()) / 2 + 1.2 * _SHOWN, 0.4)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")


def _lines(axes: Axes, modes: StructureModes, positions: Real, colour: str, width: float) -> None:
    for first, second in skeleton(modes):
        axes.plot(*positions[[first, second]].T, color=colour, linewidth=width, marker="o", markersize=2)


def _equal_axes(axes: Axes, positions: Real) -> None:
    middle = (positions.max(axis=0) + positions.min(axis=0)) / 2
    half = np.ptp(positions, axis=0).max() / 2 + _SHOWN
    for name, centre in zip(("x", "y", "z"), middle, strict=True):
        getattr(axes, f"set_{name}lim")(centre - half, centre + half)
        getattr(axes, f"{name}axis").set_ticklabels([])
        getattr(axes, f"set_{name}label")(name, labelpad=-12)
    axes.set_box_aspect((1, 1, 1), zoom=1.1)  # type: ignore[arg-type, call-arg]
    axes.view_init(elev=18, azim=-50)  # type: ignore[attr-defined]


_MOST = 12  # modes on the page

_AXIS = 0.09  # half the length of the line that shows the axis of a joint, m


def mode_page(name: str, modes: StructureModes, tables: Sequence[Table] = (), warnings: Sequence[str] = ()) -> str:
    """HTML page with an interactive picture of the robot and its modes, and tables below.

    Joints are drawn as short lines along their axes. A row on the softest direction is repeated at the top.
    """
    moving = _moving(modes)
    frequencies = ", ".join(f"{frequency:.2f}" for frequency in modes.frequencies[:4])
    verdict = (
        f"The lowest natural frequencies are {frequencies} Hz." if frequencies else "Without masses it has no modes."
    )
    softest = tuple(
        f"{row[0].capitalize()}: {row[1]}." for table in tables for row in table.rows if row[0].startswith("softest")
    )
    made_by = f"Made by millfrf {versions()['millfrf']}"
    caption = "Grey: at rest; orange: tool tip; black lines: axes of the joints. Displacements are exaggerated."
    words = f"{name} with its mode shapes" if len(moving.labels) else f"{name} at rest"
    picture = picture_of(robot_figure(modes), caption, words, moving=moving)
    rows = tuple((str(k + 1), f"{frequency:.3f}") for k, frequency in enumerate(modes.frequencies[:_MOST]))
    listed = Section("Natural frequencies", tables=(Table("Modes", ("mode", "frequency (Hz)"), rows),) if rows else ())
    page = ResultsPage("Robot in a posture", name, made_by, (verdict, *softest), tuple(warnings), picture=picture)
    return page_text(page, [listed, *(Section(table.title, tables=(table,)) for table in tables)])


def _moving(modes: StructureModes) -> MovingShapes:
    """Return the mode shapes scaled to a largest displacement of 1, with the axes of the joints."""
    count = min(_MOST, len(modes.squares))
    shapes = modes.shapes[:count, :, :3]
    largest = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    axes = tuple(
        (
            (spring.place - _AXIS * spring.axes[:, 2]).round(5).tolist(),
            (spring.place + _AXIS * spring.axes[:, 2]).round(5).tolist(),
        )
        for spring in modes.structure.springs
    )
    return MovingShapes(
        modes.structure.positions,
        tuple(skeleton(modes)),
        (shapes / np.maximum(largest, 1e-300)[:, None, None]).astype(complex),
        tuple(f"{k + 1}: {frequency:.2f} Hz" for k, frequency in enumerate(modes.frequencies[:count])),
        np.ones(len(modes.structure.positions), dtype=bool),
        axes,
        modes.structure.tip,
    )


def _joint_table(case: SpatialCase, q: Real) -> Table:
    """Make a table of the moving joints: value, limits, and stiffness along the motion of the joint."""
    mechanism, rows = case.robot.mechanism, []
    for index, value in zip(mechanism.moving, q, strict=True):
        frame = mechanism.frames[index]
        sliding = frame.motion == "prismatic"
        scale, unit = (1.0, "m") if sliding else (180 / np.pi, "deg")
        limits = "none"
        if np.isfinite([frame.lower, frame.upper]).all():
            limits = f"{scale * frame.lower:.4g} to {scale * frame.upper:.4g} {unit}"
        own = [joint.stiffness[2 if sliding else 5] for joint in case.robot.joints if joint.frame == frame.name]
        stiffness = "rigid"
        if own and np.isfinite(sum(own)):
            stiffness = f"{sum(own):.3g} {'N/m' if sliding else 'N m/rad'}"
        rows.append((frame.name, frame.motion, f"{scale * value:.4g} {unit}", limits, stiffness))
    return Table("Joints", ("joint", "motion", "value", "limits", "stiffness along its motion"), tuple(rows))


def _posture_table(case: SpatialCase, driven: Real, q: Real, result: PostureResult) -> Table:
    """Make a table with the tip's position, the moving mass and the softest direction."""
    structure = structure_at(case.robot, q)
    place = ", ".join(f"{value:.4f}" for value in structure.positions[case.robot.tip])
    values, directions = np.linalg.eigh(result.compliance[:3, :3])
    along = ", ".join(f"{value:+.2f}" for value in directions[:, -1])
    links = sum(
        beam.section.mass * float(np.linalg.norm(np.diff(structure.positions[list(beam.nodes)], axis=0)))
        for beam in structure.beams
    )
    mass = sum(body.mass for body in case.robot.bodies) + links
    rows = [
        ("posture", shown_values(case.robot.mechanism, driven)),
        ("tool tip", f"{place} m"),
        ("mass of bodies and links", f"{mass:.4g} kg" if mass else "not known"),
        ("softest direction of the tip", f"{1e-6 / values[-1]:.3g} N/µm along ({along})"),
    ]
    return Table("Posture", ("what", "value"), tuple(rows))
