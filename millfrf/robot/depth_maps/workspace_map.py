"""`millfrf robot map`: lowest frequency and certified depth limit over an area, as a picture and as a table."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, process_pool, warning_lines, writing_whole_file
from millfrf.robot_model import (
    CutPlace,
    Payload,
    SpatialRobot,
    read_robot,
    target_of,
    tool_down,
    tool_postures,
    typed_values,
)

from ...gate import check_depth, check_speed, read_checked_cutting
from ...options import check_output
from ...progress import bar
from ...provenance import add_comment, origin
from ...terminal import say
from ..along_path import PathCut, PostureValues, Request, kept_modes, values_of
from ..asked_loads import check_axis, check_degrees, check_places, check_positive
from ..postures import spatial
from ..results import say_doubts
from ..update_bands import frequency_errors, frequency_sentence
from .posture_maps import depth_over_places

Real = NDArray[np.float64]


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
        from ..picture import draw_workspace

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
