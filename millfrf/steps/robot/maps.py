"""Step ``robot map``: depth limits over postures and places."""

import csv
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from millfrf.core import TIP, InputError, Real, process_pool, warning_lines, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, origin
from millfrf.core.terminal import say
from millfrf.cutting import MillingProcess
from millfrf.gate import check_depth, check_speed, read_checked_cutting
from millfrf.options import check_output
from millfrf.robot_model import (
    CutPlace,
    Payload,
    PostureMap,
    SpatialRobot,
    model_of_modes,
    modes_at,
    posture_map,
    read_robot,
    target_of,
    tool_down,
    tool_postures,
    typed_values,
)
from millfrf.stability import certified_lobes
from modal_fit import ModalModel

from .common import frequency_errors, frequency_sentence, say_doubts
from .path_values import PathCut, PostureValues, Request, kept_modes, values_of
from .postures import check_axis, check_degrees, check_places, check_positive, spatial


def depth_limits(models: Sequence[ModalModel], process: MillingProcess, spindle_speed: float, max_depth: float) -> Real:
    """Give the largest stable depth of each model at one speed, m, (n_models,); infinite above ``max_depth``.

    :func:`millfrf.stability.certified_lobes` of each model. Where the limit has a lower bound only, that bound; where
    it is
    not resolved, zero: no depth is proven there.

    Parameters
    ----------
    models
        Modal models of receptances over TCP X, Y, Z in the axes of the cut.
    process
        Cutter and engagement.
    spindle_speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        Speed or depth not positive, or a model over other degrees of freedom.
    """
    if not (spindle_speed > 0 and max_depth > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s and depth {max_depth!r} m must be positive")
    speed, limits = np.array([spindle_speed]), np.empty(len(models))
    for i, model in enumerate(models):
        if model.responses != TIP or model.excitations != model.responses:
            raise InputError(f"depth limits need a receptance over TCP:+X, +Y, +Z, not over {model.responses}")
        found = certified_lobes(model, process, speed, max_depth)
        limits[i] = 0.0 if found.status[0] == "unresolved" else found.depth_limits[0]
    return limits


def depth_over_redundancy(
    robot: SpatialRobot,
    place: CutPlace,
    angles: Real,
    process: MillingProcess,
    spindle_speed: float,
    max_depth: float,
    redundancy: str,
) -> PostureMap:
    """Depth limit (m; ``max_depth`` where none is lower) over a redundancy angle (rad), at one speed (rad/s).

    Mousavi et al., Fig. 11: a cut that chatters in one posture is stable in another, at the same speed and depth.
    """

    def limit(model: object) -> float:
        return float(min(max_depth, depth_limits([model], process, spindle_speed, max_depth)[0]))  # type: ignore[list-item]

    return posture_map(robot, place, angles, limit, redundancy=redundancy)


def depth_over_places(
    robot: SpatialRobot,
    places: Sequence[CutPlace],
    process: MillingProcess | None,
    spindle_speed: float,
    max_depth: float,
    workers: int = 1,
) -> tuple[Real, Real]:
    """Depth limit (m) and lowest natural frequency (Hz) at each place, each (n_places,); NaN where not reached.

    Without a process the limits are NaN. The first branch of the inverse kinematics is taken: arm on the side of the
    base, elbow as the closed form gives it.
    """
    job = partial(_places, robot, process, spindle_speed, max_depth)
    if workers <= 1:
        return job(places)
    parts = [list(places[start :: 4 * workers]) for start in range(4 * workers)]
    limits, lowest = np.empty(len(places)), np.empty(len(places))
    with process_pool(workers) as pool:
        for start, (part, first) in enumerate(pool.map(job, parts)):
            limits[start :: 4 * workers], lowest[start :: 4 * workers] = part, first
    return limits, lowest


def _places(
    robot: SpatialRobot,
    process: MillingProcess | None,
    spindle_speed: float,
    max_depth: float,
    places: Sequence[CutPlace],
) -> tuple[Real, Real]:
    limits, lowest, models, at = np.full(len(places), np.nan), np.full(len(places), np.nan), [], []
    last: Real | None = None
    for i, place in enumerate(places):
        solutions = tool_postures(robot.mechanism, target_of(place), last)
        if len(solutions):
            last = solutions[0]
            modes = modes_at(robot, solutions[0])
            lowest[i] = modes.frequencies[0]
            models.append(model_of_modes(modes, robot, axes=place.axes))
            at.append(i)
    if process is not None:
        limits[at] = np.minimum(max_depth, depth_limits(models, process, spindle_speed, max_depth))
    return limits, lowest


def write_posture_map(
    path: str | os.PathLike[str], found: PostureMap, warnings: Sequence[str] = (), sliding: Sequence[bool] = ()
) -> None:
    """CSV: ``angle_deg, depth_limit_m, lowest_frequency_hz, q1_deg`` and so on; empty cells where not reached.

    Warnings stand above the headings, one ``# warning: ...`` a line. ``sliding`` says which joints are prismatic: their
    columns are in metres, ``q1_m``.
    """
    with writing_whole_file(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(warnings))
        writer = csv.writer(stream)
        slides = [place < len(sliding) and sliding[place] for place in range(found.q.shape[1])]
        joints = [f"q{place + 1}_{'m' if slide else 'deg'}" for place, slide in enumerate(slides)]
        writer.writerow(["angle_deg", "depth_limit_m", "lowest_frequency_hz", *joints])
        for angle, value, frequency, q in zip(found.angles, found.values, found.frequencies, found.q, strict=True):
            cells = [value, frequency, *np.where(slides, q, np.degrees(q))]
            writer.writerow([f"{np.degrees(angle):.6g}", *("" if np.isnan(cell) else f"{cell:.9g}" for cell in cells)])


@dataclass(frozen=True)
class Area:
    """Places of a vertical tool: axes x and y as ``LO HI N`` (m), height z (m), direction of feed (degrees)."""

    x: tuple[float, float, int]
    y: tuple[float, float, int]
    z: float
    feed: float

    def places(self) -> list[CutPlace]:
        """Places, y running first."""
        feed = np.radians(self.feed)
        return [tool_down([u, v, self.z], feed) for u in np.linspace(*self.x) for v in np.linspace(*self.y)]


def write_workspace_map(
    robot: str,
    picture: Path | None,
    area: Area,
    cutting: Path | None,
    speed: float | None,
    max_depth: float,
    out: Path | None = None,
) -> None:
    """Map of the lowest frequency, and of the depth limit where a cut is given; a picture, a table, or both."""
    _check(picture, area, cutting, speed, max_depth, out)
    case = spatial(read_robot(robot))
    say_doubts(case.assumed)
    places = area.places()
    process, doubts = (None, []) if cutting is None else read_checked_cutting(cutting)
    doubts += [*check_depth(max_depth, process), *([] if speed is None else check_speed(speed, process))]
    with bar("map"):
        if process is None or speed is None:
            _, lowest = depth_over_places(case.robot, places, None, 1.0, max_depth, workers=2)
            values, postures = None, first_postures(case.robot, places) if out is not None else []
        else:
            cut = PathCut(case.robot, process, speed * np.pi / 30, max_depth, Payload())
            postures = first_postures(case.robot, places)
            values, told = certified_over_places(cut, places, postures)
            lowest, doubts = values.lowest, [*doubts, *told]
    if np.isnan(lowest).all():
        raise InputError("no place of the area is reached; move --x, --y or --z")
    limits = np.full(len(places), np.nan) if values is None else np.minimum(values.depth, max_depth)
    if picture is not None:
        from .pictures import draw_workspace

        draw_workspace(picture, places, (area.x[2], area.y[2]), lowest, limits)
    errors = frequency_errors(case, postures) if out is not None else None
    if out is not None:
        asked = {"area": area, "speed_rpm": speed, "depth_max_m": max_depth}
        with writing_whole_file(out) as unfinished:
            _write(unfinished, case.robot, (places, postures), (lowest, errors), values, max_depth, doubts)
            add_comment(unfinished, origin("robot map", [robot, *([] if cutting is None else [cutting])], asked))
    _tell(lowest, limits, values, [one for one in (picture, out) if one is not None])
    if errors is not None:
        say(frequency_sentence(errors))
    say_doubts(doubts)


def first_postures(robot: SpatialRobot, places: Sequence[CutPlace]) -> list[Real | None]:
    """The first posture that the inverse kinematics gives at each place, (n_moving,); None where there is none."""
    found: list[Real | None] = []
    last: Real | None = None
    for place in places:
        solutions = tool_postures(robot.mechanism, target_of(place), last)
        last = solutions[0] if len(solutions) else last
        found.append(solutions[0] if len(solutions) else None)
    return found


def certified_over_places(
    cut: PathCut, places: Sequence[CutPlace], postures: Sequence[Real | None]
) -> tuple[PostureValues, list[str]]:
    """Certified limits and lowest frequencies at places in given postures, and doubts.

    Values are NaN and the status is ``not reached`` where no posture holds the tool.

    Raises
    ------
    InputError
        No place has a posture.
    """
    at = np.array([posture is not None for posture in postures])
    requests = [Request(q, place.axes, np.zeros(6)) for place, q in zip(places, postures, strict=True) if q is not None]
    if not requests:
        raise InputError("no place of the area is reached; move --x, --y or --z")
    doubts = []
    with process_pool(2) as pool:
        samples = [requests[i] for i in np.unique(np.round(np.linspace(0, len(requests) - 1, 5)).astype(int))]
        kept = kept_modes(cut, samples, pool)
        found = values_of(replace(cut, highest_frequency=kept.highest_frequency), requests, pool)
    if kept.highest_frequency < kept.reference:
        doubts.append(
            f"modes above {kept.highest_frequency:.0f} Hz are left as their static flexibility; more modes change the "
            f"limits at {kept.checked} places by at most {100 * kept.change:.2g} %"
        )
    unsure = len(found.status) - found.status.count("verified")
    if unsure:
        doubts.append(f"at {unsure} of {len(found.status)} places the limit is not verified: see status in the table")
    return found.over(at), doubts


def _check(
    picture: Path | None, area: Area, cutting: Path | None, speed: float | None, max_depth: float, out: Path | None
) -> None:
    if picture is None and out is None:
        raise InputError("a map needs a place to go: --picture FILE.png, --out FILE.csv, or both")
    for path, suffixes in ((picture, (".png", ".pdf")), (out, (".csv",))):
        if path is not None:
            check_output(path, suffixes)
    if (cutting is None) != (speed is None):
        raise InputError("a map of depth limits needs both --cutting CUT.toml and --speed RPM")
    check_axis("x", area.x)
    check_axis("y", area.y)
    check_places(z=area.z)
    check_degrees(feed=area.feed)
    check_positive("max-depth", max_depth, "metres", 1.0)
    if speed is not None:
        check_positive("speed", speed, "rpm", 1e6)


def _tell(lowest: Real, limits: Real, values: PostureValues | None, written: Sequence[Path]) -> None:
    say(f"lowest frequency {np.nanmin(lowest):.2f} to {np.nanmax(lowest):.2f} Hz")
    if values is not None:
        kinds = sorted(set(values.status) - {"not reached"})
        counts = ", ".join(f"{values.status.count(kind)} {kind}" for kind in kinds)
        say(
            f"depth limit {1e3 * np.nanmin(limits):.2f} to {1e3 * np.nanmax(limits):.2f} mm, time-periodic solution "
            f"checked by Floquet multipliers: {counts}"
        )
    names = " and ".join(str(one) for one in written)
    say(f"wrote {names}: {np.isfinite(lowest).sum()} of {len(lowest)} places reached")


def _write(
    out: Path,
    robot: SpatialRobot,
    held: tuple[Sequence[CutPlace], Sequence[Real | None]],
    frequencies: tuple[Real, Real | None],
    values: PostureValues | None,
    max_depth: float,
    doubts: Sequence[str],
) -> None:
    """One row a place; empty cells where it is not reached, or where a limit is not known."""
    lowest, errors = frequencies
    names = ["x_m", "y_m", "z_m", "reached", "lowest_frequency_hz"]
    names += ["lowest_frequency_error_hz"] if errors is not None else []
    names += ["depth_limit_m", "status", "bifurcation", "chatter_frequency_hz"] if values is not None else []
    n_joints = int(robot.mechanism.active.sum())
    names += [f"q{i + 1}" for i in range(n_joints)]
    with out.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(doubts))
        writer = csv.writer(stream)
        writer.writerow(names)
        for i, (place, q) in enumerate(zip(*held, strict=True)):
            cells: list[object] = [*place.position, "no" if q is None else "yes", lowest[i]]
            cells += [errors[i]] if errors is not None else []
            if values is not None:
                depth = np.minimum(values.depth[i], max_depth)
                cells += [depth, values.status[i], values.kind[i], values.frequency[i]]
            active = robot.mechanism.active
            cells += [np.nan] * n_joints if q is None else [*typed_values(robot.mechanism, q[active])]
            writer.writerow([_cell(cell) for cell in cells])


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.9g}"
    return str(value)
