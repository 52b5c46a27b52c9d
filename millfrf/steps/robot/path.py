"""Step ``robot path``: depth limits and deviation along a tool path, and the best postures."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from millfrf.core import InputError, Real, process_pool, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, origin
from millfrf.core.terminal import answer, say
from millfrf.cutting import MillingProcess, force_harmonics
from millfrf.gate import check_depth, check_speed, read_checked_cutting
from millfrf.options import check_output
from millfrf.robot_model import (
    CompensatedPath,
    CutPath,
    Redundancy,
    RotaryTable,
    SpatialCase,
    ToolPath,
    close_loops,
    compensate_path,
    named_posture,
    read_cut_path,
    read_robot,
    write_compensated_path,
)

from ..result_folder import refuse_file
from .common import RPM, say_doubts
from .path_optimum import PathOptimum, optimised
from .path_results import doubts, draw_path, summary, write_path_table
from .path_search import Wanted
from .path_state import OBJECTIVES, Loading
from .path_values import PathCut
from .postures import Asked, Loads, check_degrees, check_places, check_positive, posture_of, spatial


@dataclass(frozen=True)
class AskedPath:
    """Options of the optimisation.

    Parameters
    ----------
    objective, balance
        ``depth``, ``deviation`` or ``both``; share of depth where both count.
    turns
        Range and number of the turns about the tool, degrees.
    table
        Range and number of the turns of a rotary table, degrees; None: there is none.
    table_at, table_about
        A point (m) and the direction of the table's axis; None: the path's first point and its mean direction.
    joint_step, table_step
        Largest step of a joint (degrees; prismatic joints: m, as radians) and of the table between two points.
    limit_margin
        Least distance to a joint limit, degrees.
    singularity_margin
        Least singular value of the tool Jacobian (m, rad).
    """

    objective: str = "depth"
    balance: float = 0.5
    turns: tuple[float, float, int] = (-180.0, 165.0, 24)
    table: tuple[float, float, int] | None = None
    table_at: tuple[float, float, float] | None = None
    table_about: tuple[float, float, float] | None = None
    joint_step: float = 15.0
    table_step: float = 10.0
    limit_margin: float = 5.0
    singularity_margin: float = 0.05

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
            With the option, the value and the remedy.
        """
        if self.objective not in OBJECTIVES:
            raise InputError(f"--optimise {self.objective!r} is none of {', '.join(OBJECTIVES)}")
        if not 0 <= self.balance <= 1:
            raise InputError(f"--balance {self.balance:g}: give the share of depth, from 0 to 1")
        for name, axis in (("turns", self.turns), ("table", self.table)):
            if axis is not None and not (axis[0] <= axis[1] and 1 <= axis[2] <= 360 and axis[1] - axis[0] <= 720):
                raise InputError(
                    f"--{name} {axis[0]:g} {axis[1]:g} {axis[2]}: give LO HI N in degrees, LO <= HI, N 1 to 360"
                )
            if axis is not None:
                check_degrees(**{name: axis[0]})
        self._check_bounds()

    def _check_bounds(self) -> None:
        check_positive("joint-step", self.joint_step, "degrees", 180)
        check_positive("table-step", self.table_step, "degrees", 180)
        if not 0 <= self.limit_margin <= 90:
            raise InputError(f"--limit-margin {self.limit_margin:g}: give degrees, from 0 to 90")
        if not 0 <= self.singularity_margin <= 1:
            raise InputError(f"--singularity-margin {self.singularity_margin:g}: give a singular value, from 0 to 1")
        if self.table is None and (self.table_at is not None or self.table_about is not None):
            raise InputError(
                "--table-at and --table-about say where a rotary table is: give its range too, --table-turns LO HI N"
            )
        if self.table_at is not None:
            for value in self.table_at:
                check_places(**{"table-at": value})

    def redundancy(self, path: CutPath) -> Redundancy:
        """Sampled angles, zero among them where it lies in the range, and the margins."""
        tool, rotary, table = _sampled(self.turns), None, np.zeros(1)
        if self.table is not None:
            at = path.positions[0] if self.table_at is None else np.array(self.table_at)
            along = path.positions[-1] - path.positions[0]
            if self.table_about is None and np.linalg.norm(along) < 1e-6:
                raise InputError(
                    "the path ends where it begins: say about which direction the table turns, --table-about"
                )
            rotary = RotaryTable(at, along if self.table_about is None else np.array(self.table_about))
            table = _sampled(self.table)
        return Redundancy(tool, table, rotary, np.radians(self.limit_margin), self.singularity_margin)

    def wanted(self) -> Wanted:
        """What is optimised, in rad."""
        return Wanted(self.objective, self.balance, np.radians(self.joint_step), np.radians(self.table_step))


def _sampled(axis: tuple[float, float, int]) -> np.ndarray:
    return np.radians(np.linspace(*axis))


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
