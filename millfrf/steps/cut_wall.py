"""Step ``cut wall``: where stable cuts leave the wall, over spindle speed."""

import csv
import os
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from estimation import Frf
from millfrf.core import writing_whole_file
from millfrf.core.provenance import made
from millfrf.core.steps import File, Grid, Writes, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import check_depth, check_frf, check_model, rigid_directions
from millfrf.stability import SurfaceError, surface_error

from .given import (
    CutGiven,
    Depth,
    DynamicsGiven,
    Picture,
    WorkpieceGiven,
    dynamics_of,
    files_among,
    process_of,
    relative_to,
)
from .lobes import speed_axis
from .settings import RPM, STEPS

COLUMNS = ("spindle_rpm", "lowest_error_m", "mean_error_m", "highest_error_m", "stable", "unmeasured_share")


@step
def cut_wall(
    dynamics: DynamicsGiven,
    /,
    cutting: CutGiven,
    *,
    speeds: Grid,
    depth: Depth,
    workpiece: WorkpieceGiven = None,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    picture: Picture = None,
) -> SurfaceError:
    """Surface location error: how far stable cuts leave the wall from its place, at each spindle speed.

    The forced vibration of a stable cut moves the edge that makes the wall. Near the speeds with the deepest stable
    cuts a harmonic of the tooth passing meets a mode, so that the error is large there and changes its sign.

    Parameters
    ----------
    dynamics
        Modal model or FRF at the tool tip.
    cutting
        Cutter, engagement, feed and force coefficients; teeth must enter at 0 or leave at 180 degrees.
    speeds : rpm
        Lowest and highest spindle speed, and their number.
    depth : m
        Axial depth of cut.
    workpiece
        Modal model of a workpiece that moves, too, where the cut is, in the same directions; without it the workpiece
        is rigid.
    out
        Table of the error over speed to write.
    picture
        Picture of the error over speed to write.

    Returns
    -------
    SurfaceError
        Error at each speed and height.

    Raises
    ------
    InputError
        Dynamics, a cut, speeds or a depth that cannot be used.

    Examples
    --------
    ::

        $ millfrf cut wall tip.json --cutting cut.toml --speeds 2000 6000 200 --depth 0.001 --out wall.csv
    """
    structure, name, stored = dynamics_of(dynamics)
    structure, of_workpiece = relative_to(structure, workpiece)
    process, warnings = process_of(cutting)
    checked = check_frf(structure, name) if isinstance(structure, Frf) else check_model(structure, name)
    warnings = [
        *stored,
        *of_workpiece,
        *warnings,
        *check_depth(depth, process, "depth"),
        *checked,
        *rigid_directions(structure),
    ]
    result = surface_error(structure, process, speed_axis(*speeds), depth)
    warnings += wall_warnings(result, process)
    if out is not None:
        options = {"speeds_rpm": speeds, "depth_m": depth}
        _write(
            out,
            result,
            [f"provenance: {made('cut wall', files_among(dynamics, cutting, workpiece), options)}", *warnings],
        )
    if picture is not None:
        from millfrf.figures import save_figure, wall_figure

        save_figure(wall_figure(result), Path(picture))
    warn(warnings)
    tell(lambda: wall_answer(result))
    for line in wall_lines(result):
        say(line)
    say_written([file for file in (out, picture) if file is not None])
    return result


def _rows(result: SurfaceError) -> list[tuple[Any, ...]]:
    stable = [""] * len(result.error) if result.stable is None else ["yes" if each else "no" for each in result.stable]
    columns = (
        result.spindle_speeds / RPM, result.error.min(axis=1), result.error.mean(axis=1), result.error.max(axis=1),
        stable, result.unmeasured,
    )  # fmt: skip
    return list(zip(*columns, strict=True))


def _write(out: str | os.PathLike[str], result: SurfaceError, comments: list[str]) -> None:
    with writing_whole_file(out) as temporary, Path(temporary).open("w", newline="", encoding="utf-8") as file:
        for comment in comments:
            file.write(f"# {comment}\n")
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        writer.writerows([f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row] for row in _rows(result))


def wall_warnings(result: SurfaceError, process: MillingProcess) -> list[str]:
    """Warnings on motion outside the measured band, and on what the error of the wall leaves out."""
    warnings = []
    if not process.is_helical or process.runout:
        warnings.append(
            "teeth that differ, runout and process damping change the motion, which the error of the wall leaves out: "
            "compare with millfrf cut simulate at the chosen speed"
        )
    many = result.unmeasured > STEPS.unmeasured_wall
    if many.any():
        warnings.append(
            f"at {many.sum()} of {len(many)} speeds more than {100 * STEPS.unmeasured_wall:.0f} % of the motion across "
            "the wall lies outside the measured band: the error of the wall is not known there; measure a wider band"
        )
    return warnings


def wall_lines(result: SurfaceError) -> list[str]:
    """Sentences on the largest error, and on the stable speed with the smallest."""
    usable = result.unmeasured <= STEPS.unmeasured_wall
    if result.stable is not None:
        usable &= result.stable
    if not usable.any():
        return ["no speed is stable at this depth within the measured band: the error of the wall is not known"]
    worst = np.abs(result.error).max(axis=1)
    speeds = result.spindle_speeds / RPM
    best, largest = (int(f(np.where(usable, worst, fill))) for f, fill in ((np.argmin, np.inf), (np.argmax, -np.inf)))

    def words(at: int) -> str:
        low, high = 1e6 * result.error[at].min(), 1e6 * result.error[at].max()
        return f"{low:+.3g} to {high:+.3g} µm at {speeds[at]:.0f} rpm"

    return [
        f"wall of {result.wall} milling at {1e3 * result.depth:g} mm (+: too much is removed): smallest error "
        f"{words(best)}, largest {words(largest)}",
        f"{usable.sum()} of {len(usable)} speeds are "
        + (
            "within the measured band; which of them are stable, lobes of the FRF say"
            if result.stable is None
            else "stable at this depth without modes that were not measured, and their forced vibration lies in the "
            "measured band"
        ),
    ]


def wall_answer(result: SurfaceError) -> dict[str, Any]:
    """Error at each speed as numbers."""
    return {
        "wall": result.wall,
        "depth_m": result.depth,
        "speeds": [dict(zip(COLUMNS, row, strict=True)) for row in _rows(result)],
    }
