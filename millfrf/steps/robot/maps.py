"""Step ``robot map``: lowest frequencies and depth limits over places, and over a redundancy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from millfrf.core import TIP, InputError, Real, process_pool, write_csv
from millfrf.core.compilation import STABILITY
from millfrf.core.progress import progress
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Grid, step
from millfrf.core.terminal import manner, say, say_written, warn
from millfrf.cutting import MillingProcess
from millfrf.figures import save_figure
from millfrf.gate import check_depth, check_speed
from millfrf.robot_model import (
    CutPlace,
    Mechanism,
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

from ..given import CutGiven, Degrees, Depth, Height, Picture, Robot, Speed, TableFile, files_among, process_of
from ..settings import PATH, RPM
from .along_path.values import PathCut, PostureRequest, PostureValues, kept_modes, values_of
from .pictures import workspace_figure
from .postures import check_axis, spatial
from .uncertainty import frequency_errors, frequency_sentence


@dataclass(frozen=True, eq=False)
class WorkspaceMap:
    """Lowest natural frequency, and depth limit, of a vertical tool over an area."""

    places: tuple[CutPlace, ...]  # y varies first
    postures: tuple[Real | None, ...]  # joint values (n_moving,) at each place; None where the robot does not reach it
    lowest: Real  # (n_places,), Hz; lowest natural frequency; NaN where the place is not reached
    # (n_places,), Hz, or None; standard errors of the frequencies; None where the robot's file was never updated
    errors: Real | None
    values: PostureValues | None  # certified limits with their status; None without a cut
    limits: Real  # (n_places,), m; depth limits, at most the largest depth that was searched; NaN where there is none
    warnings: tuple[str, ...]


@step
def robot_map(
    robot: Robot,
    /,
    *,
    picture: Picture = None,
    out: TableFile = None,
    x: Grid = (0.5, 1.4, 19),
    y: Grid = (-0.7, 0.7, 29),
    z: Height = 0.8,
    feed: Degrees = 0.0,
    cutting: CutGiven | None = None,
    speed: Speed | None = None,
    max_depth: Depth = 0.02,
) -> WorkspaceMap:
    """Lowest natural frequency of a vertical tool over an area, and with --cutting the depth limit.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    picture
        Map to write.
    out
        Table to write: frequency, limit, status and joint values of each place.
    x : m
        Lowest and highest x of the tool tip, and the number of places.
    y : m
        Lowest and highest y of the tool tip, and the number of places.
    z : m
        Height of the tool tip.
    feed : deg
        Direction of the feed from the base's x.
    cutting
        Cutter, engagement and force coefficients, for depth limits at one spindle speed.
    speed : rpm
        Spindle speed, with --cutting.
    max_depth : m
        Largest axial depth that is searched.

    Returns
    -------
    WorkspaceMap
        Frequencies, limits and postures of all places, and the warnings.

    Raises
    ------
    InputError
        An area of which the robot reaches nothing, or a cut without speed.

    Examples
    --------
    ::

        $ millfrf robot map staubli_rx170 --cutting cut.toml --speed 3000 --feed 90 --picture map.png
    """
    if picture is None and out is None and not manner().silent:
        raise InputError("give an output of the map: --picture FILE.png, --out FILE.csv, or both")
    if (cutting is None) != (speed is None):
        raise InputError("a map of depth limits needs both --cutting CUT.toml and --speed RPM")
    check_axis("x", x)
    check_axis("y", y)
    case = spatial(read_robot(robot))
    warn(case.assumed)
    process, warnings = (None, []) if cutting is None else process_of(cutting)
    warnings += [*check_depth(max_depth, process), *([] if speed is None else check_speed(speed, process))]
    directions = np.radians(feed)
    places = [tool_down([u, v, z], directions) for u in np.linspace(*x) for v in np.linspace(*y)]
    with progress("map"):
        postures = first_postures(case.robot, places)
        if process is None or speed is None:
            lowest, values = depth_over_places(case.robot, places, None, 1.0, max_depth, workers=2)[1], None
        else:
            cut = PathCut(case.robot, process, speed * RPM, max_depth, Payload())
            values, notes = certified_over_places(cut, places, postures)
            lowest, warnings = values.lowest, [*warnings, *notes]
    if np.isnan(lowest).all():
        raise InputError("no place of the area is reached; move --x, --y or --z")
    limits = np.full(len(places), np.nan) if values is None else np.minimum(values.depth, max_depth)
    errors = None if out is None else frequency_errors(case, postures)
    area = WorkspaceMap(tuple(places), tuple(postures), lowest, errors, values, limits, tuple(warnings))
    if picture is not None:
        save_figure(workspace_figure(places, (x[2], y[2]), lowest, limits), picture)
    if out is not None:
        options = {"x_m": x, "y_m": y, "z_m": z, "feed_deg": feed, "speed_rpm": speed, "depth_max_m": max_depth}
        columns, rows = _table(case.robot.mechanism, area)
        made_of = origin("robot map", files_among(robot, cutting), options)
        write_csv(out, columns, rows, warnings=area.warnings, provenance=made_of)
    _say_map(area, [file for file in (picture, out) if file is not None])
    warn(area.warnings)
    return area


def _say_map(area: WorkspaceMap, written: Sequence[File]) -> None:
    """Print the ranges of the map, and which files were written."""
    lowest, limits, values = area.lowest, area.limits, area.values
    say(f"lowest frequency {np.nanmin(lowest):.2f} to {np.nanmax(lowest):.2f} Hz")
    if values is not None:
        kinds = sorted(set(values.status) - {"not reached"})
        counts = ", ".join(f"{values.status.count(kind)} {kind}" for kind in kinds)
        say(
            f"depth limit {1e3 * np.nanmin(limits):.2f} to {1e3 * np.nanmax(limits):.2f} mm, time-periodic solution "
            f"checked by Floquet multipliers: {counts}"
        )
    say_written(written, f"{np.isfinite(lowest).sum()} of {len(lowest)} places reached")
    if area.errors is not None:
        say(frequency_sentence(area.errors))


def _table(mechanism: Mechanism, area: WorkspaceMap) -> tuple[list[str], list[list[object]]]:
    """Return headings and a row for each place; cells are NaN if the place is not reached or the limit not known."""
    values, errors = area.values, area.errors
    names = ["x_m", "y_m", "z_m", "reached", "lowest_frequency_hz"]
    names += ["lowest_frequency_error_hz"] if errors is not None else []
    names += ["depth_limit_m", "status", "bifurcation", "chatter_frequency_hz"] if values is not None else []
    n_joints = int(mechanism.active.sum())
    names += [f"q{i + 1}" for i in range(n_joints)]
    rows = []
    for i, (place, q) in enumerate(zip(area.places, area.postures, strict=True)):
        cells: list[object] = [*place.position, "no" if q is None else "yes", area.lowest[i]]
        cells += [errors[i]] if errors is not None else []
        if values is not None:
            cells += [area.limits[i], values.status[i], values.kind[i], values.frequency[i]]
        cells += [np.nan] * n_joints if q is None else [*typed_values(mechanism, q[mechanism.active])]
        rows.append(cells)
    return names, rows


def depth_limits(models: Sequence[ModalModel], process: MillingProcess, spindle_speed: float, max_depth: float) -> Real:
    """Largest stable depth of each model at one speed (rad/s), (n_models,), m; infinite above ``max_depth`` (m).

    The models are receptances over TCP X, Y, Z in the axes of the cut. A limit with a lower bound only is that bound;
    an unresolved limit is zero, since no depth is proven.
    """
    if not (spindle_speed > 0 and max_depth > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s and depth {max_depth!r} m must be positive")
    speed, limits = np.array([spindle_speed]), np.empty(len(models))
    for i, model in enumerate(models):
        if model.responses != TIP or model.excitations != model.responses:
            raise InputError(f"depth limits need a receptance over TCP:+X, +Y, +Z, not over {model.responses}")
        lobes = certified_lobes(model, process, speed, max_depth)
        limits[i] = 0.0 if lobes.status[0] == "unresolved" else lobes.depth_limits[0]
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
    """Depth limit (m; NaN without a process) and lowest natural frequency (Hz) at each place; NaN where not reached.

    The first branch of the inverse kinematics is taken: arm on the side of the base, elbow as in the closed form.
    """
    job = partial(_places, robot, process, spindle_speed, max_depth)
    if workers <= 1:
        return job(places)
    parts = [list(places[start :: 4 * workers]) for start in range(4 * workers)]
    limits, lowest = np.empty(len(places)), np.empty(len(places))
    with process_pool(workers, STABILITY) as pool:
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


def posture_table(postures: PostureMap, sliding: Sequence[bool] = ()) -> tuple[tuple[str, ...], list[list[float]]]:
    """Return headings and rows of angles, depth limits, frequencies and joint values; NaN where not reached.

    ``sliding`` states which joints are prismatic: their columns are in metres, ``q1_m``, the others in degrees.
    """
    slides = [place < len(sliding) and sliding[place] for place in range(postures.q.shape[1])]
    joints = [f"q{place + 1}_{'m' if slide else 'deg'}" for place, slide in enumerate(slides)]
    rows = []
    values = (postures.angles, postures.values, postures.frequencies, postures.q)
    for angle, value, frequency, q in zip(*values, strict=True):
        rows.append([float(np.degrees(angle)), value, frequency, *np.where(slides, q, np.degrees(q))])
    return ("angle_deg", "depth_limit_m", "lowest_frequency_hz", *joints), rows


def first_postures(robot: SpatialRobot, places: Sequence[CutPlace]) -> list[Real | None]:
    """First solution of the inverse kinematics at each place, (n_moving,); None without a solution."""
    postures: list[Real | None] = []
    last: Real | None = None
    for place in places:
        solutions = tool_postures(robot.mechanism, target_of(place), last)
        last = solutions[0] if len(solutions) else last
        postures.append(solutions[0] if len(solutions) else None)
    return postures


def certified_over_places(
    cut: PathCut, places: Sequence[CutPlace], postures: Sequence[Real | None]
) -> tuple[PostureValues, list[str]]:
    """Certified limits and lowest frequencies in the postures, NaN and ``not reached`` without one; and warnings."""
    at = np.array([posture is not None for posture in postures])
    requests = [
        PostureRequest(q, place.axes, np.zeros(6)) for place, q in zip(places, postures, strict=True) if q is not None
    ]
    if not requests:
        raise InputError("no place of the area is reached; move --x, --y or --z")
    warnings = []
    with process_pool(PATH.workers, STABILITY) as pool:
        samples = [requests[i] for i in np.unique(np.round(np.linspace(0, len(requests) - 1, 5)).astype(int))]
        kept = kept_modes(cut, samples, pool)
        values = values_of(replace(cut, highest_frequency=kept.highest_frequency), requests, pool)
    if kept.highest_frequency < kept.reference:
        warnings.append(
            f"modes above {kept.highest_frequency:.0f} Hz are replaced by their static flexibility; more modes change "
            f"the limits at {kept.checked} places by at most {100 * kept.change:.2g} %"
        )
    unverified = len(values.status) - values.status.count("verified")
    if unverified:
        warnings.append(
            f"at {unverified} of {len(values.status)} places the limit is not verified: see status in the table"
        )
    return values.over(at), warnings
