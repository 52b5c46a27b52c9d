"""Maps of depth limits over postures: over redundancy angles, and over many places on several processes."""

import csv
import os
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from millfrf.core import process_pool, warning_lines, writing_whole_file
from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    CutPlace,
    PostureMap,
    SpatialRobot,
    model_of_modes,
    modes_at,
    posture_map,
    target_of,
    tool_postures,
)

from .depth_map import depth_limits

Real = NDArray[np.float64]


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
