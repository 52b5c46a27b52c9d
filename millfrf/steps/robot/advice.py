"""Step ``robot advice``: depth and spindle speed along a tool path, from measured postures."""

from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from millfrf.core import InputError, process_pool, refuse_replacing, write_csv
from millfrf.core.compilation import STABILITY
from millfrf.core.provenance import origin
from millfrf.core.steps import File, Grid, Reads, Typed, Writes, step
from millfrf.core.terminal import say, say_written, warn
from millfrf.figures import save_figure
from millfrf.gate import check_depth, check_speeds
from millfrf.robot_model import close_loops, path_segments, read_cut_path, read_learned_postures, read_robot
from millfrf.stability import CONFIDENCE, DRIFT

from ..given import CutGiven, Depth, Joints, Picture, Pose, Robot, files_among, process_of
from ..lobes import speed_axis
from ..settings import PATH
from .along_path.advice import AdvisedCut, PathAdvice, advise_along
from .along_path.advice_results import COLUMNS, advice_figure, advice_sentences, advice_table, advice_warnings
from .along_path.results import plunge_warnings
from .postures import posture_of, spatial


@step
def robot_advice(
    robot: Robot,
    path: Annotated[File, Reads("PATH.csv")],
    /,
    *,
    learned: Annotated[File, Reads("FILE.json")],
    cutting: CutGiven,
    speeds: Grid,
    max_depth: Depth | None = None,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    segments: Annotated[int | None, Typed("N"), Ge(1), Le(10_000)] = None,
    speed_error: Annotated[float, Typed("SHARE"), Ge(0), Le(0.2)] = DRIFT,
    pose: Pose = None,
    joints: Joints = None,
    picture: Picture = None,
) -> PathAdvice:
    """Depth and spindle speed for each segment of a tool path, from postures learned by `robot learn`.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    path
        Path of the tool tip: columns x_m y_m z_m, and i j k (tool axis) or rx_rad ry_rad rz_rad.
    learned
        File that `robot learn` wrote.
    cutting
        Cutter, engagement and force coefficients.
    speeds : rpm
        Lowest and highest spindle speed to choose from, and their number.
    max_depth : m
        Largest axial depth that is searched; without it one diameter of the cutter.
    out
        Table to write: a row for each segment.
    segments
        Number of segments of equal length; without it one from each point of the path to the next.
    speed_error
        Largest relative deviation of the spindle speed, inside which the depth holds.
    pose
        Posture named in the robot's file near which the path begins; without it the first one.
    joints : deg
        Values of the driven joints near which the path begins; of prismatic joints in metres.
    picture
        Picture of depth and speed along the path to write.

    Returns
    -------
    PathAdvice
        Limits with their bands at each speed, and the segments.

    Raises
    ------
    InputError
        A path that the robot does not reach, postures of another robot, or a turning cut.

    Examples
    --------
    ::

        $ millfrf robot advice kuka.toml path.csv --learned p.json --cutting cut.toml --speeds 2e3 4e3 9 --out a.csv
    """
    for file in (out, picture):
        if file is not None:
            refuse_replacing(Path(file))  # before the long computation
    process, warnings = process_of(cutting)
    if process.is_turning:
        raise InputError("the cut is turning: a tool path is milled, give a cutting file with the table [cutting]")
    deepest = process.diameter if max_depth is None else max_depth
    warnings += [*check_depth(deepest, process), *check_speeds(speeds, process)]
    case, cut_path = spatial(read_robot(robot)), read_cut_path(path)
    postures = read_learned_postures(learned, case.robot)
    start = close_loops(case.robot.mechanism, posture_of(case, pose, joints)[0])
    cut = AdvisedCut(process, speed_axis(*speeds), deepest, speed_error)
    with process_pool(PATH.workers, STABILITY) as pool:
        advice = advise_along(postures, cut_path, path_segments(cut_path, segments), cut, start, pool)
    warnings += [*case.assumed, *plunge_warnings(cut_path), *advice_warnings(advice)]
    for line in advice_sentences(advice):
        say(line)
    if out is not None:
        options = {"speeds_rpm": speeds, "max_depth_m": deepest, "segments": segments, "speed_error": speed_error}
        options |= {"pose": pose, "joints": joints, "confidence": CONFIDENCE}
        made_of = origin("robot advice", files_among(robot, path, learned, cutting), options)
        write_csv(out, COLUMNS, advice_table(advice), warnings=warnings, provenance=made_of)
    if picture is not None:
        save_figure(advice_figure(advice), picture)
    say_written([file for file in (out, picture) if file is not None])
    warn(warnings)
    return advice
