"""Step ``robot path``: depth limits and deviation along a tool path, and the best postures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Le
from scipy.spatial.transform import Rotation

from millfrf.core import InputError, Real, process_pool, refuse_replacing, write_csv
from millfrf.core.compilation import STABILITY
from millfrf.core.progress import progress
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Grid, Reads, Typed, Writes, step
from millfrf.core.terminal import say, say_written, warn
from millfrf.cutting import MillingProcess, force_harmonics
from millfrf.figures import save_figure
from millfrf.gate import check_depth, check_speed
from millfrf.robot_model import (
    CompensatedPath,
    CutPath,
    Redundancy,
    RotaryTable,
    SpatialCase,
    ToolPath,
    close_loops,
    compensate_path,
    read_cut_path,
    read_robot,
    write_compensated_path,
)

from ..diagnose import refuse_file
from ..given import At, CutGiven, Depth, Joints, Kilograms, NearTip, Pose, Robot, Speed, Weight, files_among, process_of
from ..settings import PATH, RPM
from .along_path.optimum import PathOptimum, optimise_postures
from .along_path.results import path_figure, path_table, path_warnings, summary
from .along_path.search import PathGoal
from .along_path.state import Loading, Objective
from .along_path.values import PathCut
from .postures import Loads, loads_of, posture_of, spatial

FILES = ("path.csv", "path.png", "compensated.csv")  # files that are written into a folder


@step
def robot_path(
    robot: Robot,
    path: Annotated[File, Reads("PATH.csv")],
    /,
    *,
    cutting: CutGiven,
    speed: Speed,
    out: Annotated[File | None, Writes("DIR|FILE.csv", needed=True, files=FILES)] = None,
    optimise: Objective = "depth",
    depth: Depth | None = None,
    max_depth: Annotated[float, Typed("M"), Gt(0), Le(1)] = 0.02,
    turns: Grid = (-180.0, 165.0, 24),
    table_turns: Grid | None = None,
    table_at: At = None,
    table_about: Annotated[tuple[float, float, float] | None, Typed("X Y Z")] = None,
    balance: Annotated[float, Typed("0...1"), Ge(0), Le(1)] = 0.5,
    joint_step: Annotated[float, Typed("DEG"), Gt(0), Le(180)] = 15.0,
    table_step: Annotated[float, Typed("DEG"), Gt(0), Le(180)] = 10.0,
    limit_margin: Annotated[float, Typed("DEG"), Ge(0), Le(90)] = 5.0,
    singularity_margin: Annotated[float, Ge(0), Le(1)] = 0.05,
    pose: Pose = None,
    joints: Joints = None,
    payload: Kilograms = 0.0,
    payload_at: NearTip = None,
    weight: Weight = "all",
) -> PathOptimum:
    """Postures along a tool path by its redundancy: largest depth, least deviation or both; the compensated path.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    path
        Path of the tool tip: columns x_m y_m z_m, and i j k (tool axis) or rx_rad ry_rad rz_rad.
    cutting
        Cutter, engagement and force coefficients.
    speed : rpm
        Spindle speed along the whole path.
    out
        Folder for table, picture and compensated path; or .csv for the table alone.
    optimise
        Objective: the smallest depth limit, the largest deviation, or both.
    depth : m
        Depth of the planned cut, whose mean force deflects the robot; without it the path's columns fx_n fy_n fz_n.
    max_depth : m
        Largest axial depth that is searched.
    turns : deg
        Lowest and highest turn about the tool's axis, and their number.
    table_turns : deg
        Lowest and highest turn of a rotary table that carries the work, and their number.
    table_at : m
        Point of the table's axis; without it the path's first point.
    table_about
        Direction of the table's axis; without it that from the path's first to its last point.
    balance
        Weight of the depth against the deviation if both are optimised.
    joint_step : deg
        Largest step of a joint between two points; of prismatic joints in metres, as radians.
    table_step : deg
        Largest step of the table between two points.
    limit_margin : deg
        Least distance to a joint limit.
    singularity_margin
        Least singular value of the tool Jacobian (m, rad).
    pose
        Posture named in the robot's file near which the path begins; without it the first one.
    joints : deg
        Values of the driven joints near which the path begins; of prismatic joints in metres.
    payload : kg
        Mass that the robot carries besides the bodies of its file.
    payload_at : m
        Centre of mass of the payload from the tip, in the tool frame; without it the tip.
    weight
        Deflection under weight that counts: all; its change from the first place, where the work was touched off; none.

    Returns
    -------
    PathOptimum
        Postures, depth limits and deviations with the redundancy at zero and as chosen.

    Raises
    ------
    InputError
        A path that the robot does not reach within the margins, no continuous sequence, or no forces.

    Examples
    --------
    ::

        $ millfrf robot path kuka_kr90_r3100 path.csv --cutting cut.toml --speed 3000 --out along
    """
    check_turns("turns", turns)
    if table_turns is not None:
        check_turns("table-turns", table_turns)
    elif table_at is not None or table_about is not None:
        raise InputError(
            "--table-at and --table-about are the axis of a rotary table: give its range too, --table-turns LO HI N"
        )
    alone = out is not None and Path(out).suffix.lower() == ".csv"
    if out is not None:
        refuse_replacing(Path(out)) if alone else refuse_file(Path(out))
    process, warnings = process_of(cutting)
    warnings += [*check_depth(max_depth, process), *check_speed(speed, process)]
    case, loads = spatial(read_robot(robot)), loads_of(payload, payload_at, weight)
    warn(case.assumed)
    if not case.robot.bodies:
        raise InputError(f"{robot} gives no masses: it has statics, but no modes and no depth limits; add [[bodies]]")
    cut_path = read_cut_path(path)
    loading = Loading(_wrenches(cut_path, process, depth), weight)
    table = None if table_turns is None else rotary_table(cut_path, table_at, table_about)
    angles = [np.zeros(1) if axis is None else np.radians(np.linspace(*axis)) for axis in (turns, table_turns)]
    free = Redundancy(angles[0], angles[1], table, np.radians(limit_margin), singularity_margin)
    wanted = PathGoal(optimise, balance, np.radians(joint_step), np.radians(table_step))
    cut = PathCut(case.robot, process, speed * RPM, max_depth, loads.payload)
    start = close_loops(case.robot.mechanism, posture_of(case, pose, joints)[0])
    with progress("postures along the path"), process_pool(PATH.workers, STABILITY) as pool:
        optimum = optimise_postures(cut, cut_path, free, loading, wanted, start, pool)
    warnings += path_warnings(optimum, cut_path)
    for line in summary(optimum, wanted, max_depth, depth):
        say(line)
    if out is not None:
        options: dict[str, Any] = {
            "rpm": speed,
            "depth_m": depth,
            "loads": loads,
            "optimise": wanted,
            "turns_deg": turns,
        }
        options |= {"table_turns_deg": table_turns, "table_at_m": table_at, "table_about": table_about}
        options |= {"limit_margin_deg": limit_margin, "singularity_margin": singularity_margin}
        made_of = origin("robot path", files_among(robot, path, cutting), options)
        if alone:
            _write_table(Path(out), case, optimum, max_depth, warnings, made_of)
            say_written([out])
        else:
            corrected = _compensated(case, optimum, loading, loads)
            warnings += corrected.warnings
            _write_folder(Path(out), case, cut_path, optimum, corrected, (max_depth, depth), warnings, made_of)
    warn(warnings)
    return optimum


def check_turns(name: str, turns: tuple[float, float, int]) -> None:
    """Refuse a range of angles that is empty, decreasing or more than two turns wide."""
    low, high, count = turns
    if not (low <= high <= low + 720 and 1 <= count <= 360 and abs(low) <= 1080):
        raise InputError(f"--{name} {low:g} {high:g} {count}: give LO HI N in degrees, LO <= HI, N 1 to 360")


def rotary_table(
    path: CutPath, at: tuple[float, float, float] | None, about: tuple[float, float, float] | None
) -> RotaryTable:
    """Rotary table with its axis through a point (m) and in a direction; None: the first point, towards the last."""
    along = path.positions[-1] - path.positions[0]
    if about is None and np.linalg.norm(along) < 1e-6:
        raise InputError("the path ends where it begins: say about which direction the table turns, --table-about")
    return RotaryTable(path.positions[0] if at is None else np.array(at), along if about is None else np.array(about))


def _wrenches(path: CutPath, process: MillingProcess, depth: float | None) -> Real:
    """Return force and moment on the tool at each point, six columns, in the axes of the cut.

    They are the mean force of the cut, or the columns of the file.
    """
    if depth is not None:
        check_depth(depth, process, "--depth")
        straight = replace(process, helix_angle=0.0, helix_angles=(), pitch_angles=(), process_damping=0.0)
        wrench = np.zeros(6)
        wrench[:3] = depth * force_harmonics(straight, 0)[0].real
        return np.tile(wrench, (len(path.places), 1))
    if path.wrenches is None:
        raise InputError(
            "the path has no forces: give the depth of the planned cut, --depth M, or columns fx_n fy_n fz_n"
        )
    turns = [np.kron(np.eye(2), place.axes) for place in path.places]
    return np.array([turn.T @ wrench for turn, wrench in zip(turns, path.wrenches, strict=True)])


def _compensated(case: SpatialCase, optimum: PathOptimum, loading: Loading, loads: Loads) -> CompensatedPath:
    """Return the path corrected for the deflection in the chosen postures."""
    after, active = optimum.after, case.robot.mechanism.active
    wrenches = np.einsum("kij,kj->ki", np.array([np.kron(np.eye(2), axes) for axes in after.axes]), loading.wrenches)
    attitudes = Rotation.from_matrix(after.attitudes).as_rotvec()
    path = ToolPath(after.positions, attitudes, wrenches)
    return compensate_path(case.robot, path, after.q[0][active], payload=loads.payload, weight=loads.weight)


def _write_table(
    table: Path,
    case: SpatialCase,
    optimum: PathOptimum,
    max_depth: float,
    warnings: Sequence[str],
    made_of: Mapping[str, Any],
) -> None:
    columns, rows = path_table(case.robot.mechanism, optimum.before, optimum.after, max_depth)
    write_csv(table, columns, rows, warnings=warnings, provenance=made_of)


def _write_folder(
    folder: Path,
    case: SpatialCase,
    path: CutPath,
    optimum: PathOptimum,
    corrected: CompensatedPath,
    depths: tuple[float, float | None],
    warnings: Sequence[str],
    made_of: Mapping[str, Any],
) -> None:
    """Write table, picture and compensated path; ``depths`` are the largest depth searched and the planned depth, m."""
    max_depth, planned = depths
    folder.mkdir(parents=True, exist_ok=True)
    table, picture, compensated = (folder / name for name in FILES)
    _write_table(table, case, optimum, max_depth, warnings, made_of)
    save_figure(path_figure(path, optimum.before, optimum.after, max_depth, planned), picture)
    write_compensated_path(compensated, corrected, made_of)
    left = 1e3 * np.linalg.norm(corrected.left[:, :3], axis=1).max()
    say(f"compensated path: {1e3 * left:.2g} um remain by the same model")
    say_written([table, picture, compensated])
