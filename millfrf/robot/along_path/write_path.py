"""`millfrf robot path` from options to files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from millfrf.core import InputError, process_pool, writing_whole_file
from millfrf.cutting import MillingProcess, force_harmonics
from millfrf.robot_model import (
    CompensatedPath,
    CutPath,
    SpatialCase,
    ToolPath,
    close_loops,
    compensate_path,
    named_posture,
    read_cut_path,
    read_robot,
    write_compensated_path,
)

from ...gate import check_depth, check_speed, read_checked_cutting
from ...options import check_output
from ...progress import bar
from ...provenance import add_comment, origin
from ...result_folder import refuse_file
from ...terminal import answer, say
from ..asked_loads import Loads, check_positive
from ..postures import Asked, posture_of, spatial
from ..results import RPM, say_doubts
from .asked_path import AskedPath
from .optimum import PathOptimum, optimised
from .path_state import Loading
from .posture_values import PathCut
from .telling import doubts, draw_path, summary, write_path_table

Real = NDArray[np.float64]

WORKERS = 2
"""Processes that evaluate postures."""


def write_optimised_path(
    robot: str,
    path_file: Path,
    cutting: Path,
    speeds: tuple[float, float, float | None],
    asked: AskedPath,
    start: Asked,
    loads: Loads,
    out: Path,
) -> None:
    """Optimise a path and write table, picture and compensated path.

    Parameters
    ----------
    speeds
        Spindle speed (rpm), largest depth (m), and depth of the planned cut (m) or None.
    out
        A folder, or a ``.csv`` for the table alone.
    """
    rpm, max_depth, depth = speeds
    asked.check()
    alone = out.suffix.lower() == ".csv"
    check_output(out, (".csv",), [path_file]) if alone else refuse_file(out)
    check_positive("max-depth", max_depth, "metres", 1.0)
    process, warnings = read_checked_cutting(cutting)
    warnings += [*check_depth(max_depth, process), *check_speed(rpm, process)]
    case = spatial(read_robot(robot))
    say_doubts(case.assumed)
    if not case.robot.bodies:
        raise InputError(f"{robot} gives no masses: it has statics, but no modes and no depth limits; add [[bodies]]")
    path = read_cut_path(path_file)
    loading = Loading(_wrenches(path, process, depth), loads.weight)
    cut = PathCut(case.robot, process, rpm * RPM, max_depth, loads.payload)
    first = close_loops(case.robot.mechanism, posture_of(case, start)[0])
    with bar("postures along the path"), process_pool(WORKERS) as pool:
        found = optimised(cut, path, asked.redundancy(path), loading, asked.wanted(), first, pool)
    warnings += doubts(found, path)
    for line in summary(found, asked.wanted(), max_depth, depth):
        answer(line)
    told = origin(
        "robot path", [robot, path_file, cutting], {"rpm": rpm, "depth_m": depth, "asked": asked, "loads": loads}
    )
    if alone:
        _write_table(out, case, found, max_depth, warnings, told)
    else:
        corrected = _compensated(case, found, loading, loads)
        warnings += corrected.warnings
        out.mkdir(parents=True, exist_ok=True)
        _write_table(out / "path.csv", case, found, max_depth, warnings, told)
        draw_path(out / "path.png", path, found.before, found.after, max_depth, depth)
        with writing_whole_file(out / "compensated.csv") as unfinished:
            write_compensated_path(unfinished, corrected)
            add_comment(unfinished, told)
        left = 1e3 * np.linalg.norm(corrected.left[:, :3], axis=1).max()
        say(f"compensated path: {1e3 * left:.2g} um are left by the same model")
        say(f"wrote path.csv, path.png and compensated.csv in {out}")
    say_doubts(warnings)


def _wrenches(path: CutPath, process: MillingProcess, depth: float | None) -> Real:
    """Force and moment on the tool in the axes of the cut, (n, 6): the mean force of the cut, or that of the file."""
    if depth is not None:
        check_depth(depth, process, "--depth")
        straight = replace(process, helix_angle=0.0, pitch_angles=(), process_damping=0.0)
        wrench = np.zeros(6)
        wrench[:3] = depth * force_harmonics(straight, 0)[0].real
        return np.tile(wrench, (len(path.places), 1))
    if path.wrenches is None:
        raise InputError(
            "the path tells no forces: give the depth of the planned cut, --depth M, or columns fx_n fy_n fz_n"
        )
    turns = [np.kron(np.eye(2), place.axes) for place in path.places]
    return np.array([turn.T @ wrench for turn, wrench in zip(turns, path.wrenches, strict=True)])


def _compensated(case: SpatialCase, found: PathOptimum, loading: Loading, loads: Loads) -> CompensatedPath:
    """The chosen path moved against its deflection, in the chosen postures."""
    after, active = found.after, case.robot.mechanism.active
    wrenches = np.einsum("kij,kj->ki", np.array([np.kron(np.eye(2), axes) for axes in after.axes]), loading.wrenches)
    attitudes = Rotation.from_matrix(after.attitudes).as_rotvec()
    path = ToolPath(after.positions, attitudes, wrenches)
    return compensate_path(case.robot, path, after.q[0][active], payload=loads.payload, weight=loads.weight)


def _write_table(
    out: Path, case: SpatialCase, found: PathOptimum, max_depth: float, warnings: list[str], told: dict[str, object]
) -> None:
    with writing_whole_file(out) as unfinished:
        write_path_table(unfinished, case.robot.mechanism, found.before, found.after, max_depth, warnings)
        add_comment(unfinished, told)


def start_of(case: SpatialCase) -> Real:
    """Joint values (n_moving,) of the first posture of a robot's file."""
    return close_loops(case.robot.mechanism, named_posture(case, None))
