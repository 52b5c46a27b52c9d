"""Step ``robot lobes``: stability lobes in a posture, and depth limits over its redundancy."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from millfrf.core import InputError, Real, refuse_replacing, write_csv
from millfrf.core.progress import progress
from millfrf.core.provenance import made, origin
from millfrf.core.steps import File, Grid, Reads, Typed, Writes, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.figures import LobesBand, lobes_figure, save_figure
from millfrf.gate import check_depth, check_speed, check_speeds, lowest_frequency
from millfrf.robot_model import CutPlace, PlanarCase, PostureMap, SpatialCase, in_posture, read_robot, shown_values
from millfrf.stability import LimitBand, StabilityLobes, write_lobes

from ..answers import lobes_answer
from ..given import At, CutGiven, Degrees, Depth, Joints, Picture, Pose, Robot, Speed, Turning, files_among, process_of
from ..lobes import LobeMethod, compute_lobes, lobes_summary, speed_axis
from ..settings import LOBES, RPM
from .learned import DepthBand, depth_band, depth_band_figure, predicted_posture, write_depth_band
from .maps import depth_over_redundancy, posture_table
from .pictures import posture_figure
from .postures import cut_place, mechanism_of, posture_of, spatial
from .tip_lobes import lobes_at_the_tip
from .uncertainty import band_path, write_band


@step
def robot_lobes(
    robot: Robot,
    /,
    *,
    cutting: CutGiven,
    max_depth: Depth,
    out: Annotated[File | None, Writes(suffixes=(".csv",), needed=True)] = None,
    at: At = None,
    pose: Pose = None,
    joints: Joints = None,
    feed: Degrees = 0.0,
    turn: Degrees = 0.0,
    redundancy: Turning = "table",
    links: bool = False,
    speeds: Grid | None = None,
    turns: Grid | None = None,
    speed: Speed | None = None,
    method: LobeMethod = "certified",
    picture: Picture = None,
    depth: Annotated[float | None, Typed("M"), Gt(0)] = None,
    learned: Annotated[File | None, Reads("POSTURES.json")] = None,
) -> StabilityLobes | PostureMap:
    """Stability lobes in a posture (--speeds), or the depth limit over a redundancy angle (--turns and --speed).

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    cutting
        Cutter, engagement and force coefficients.
    max_depth : m
        Largest axial depth that is searched.
    out
        Table of lobes to write, or with --turns a posture map.
    at : m
        Place of the tip of a vertical tool, instead of a posture.
    pose
        Posture named in the robot's file; without it the first one.
    joints : deg
        Values of the driven joints; of prismatic joints in metres.
    feed : deg
        Direction of the feed from the base's x, with --at.
    turn : deg
        Turn of the redundancy, with --at.
    redundancy
        What turns, with --at: the robot about the tool's axis (tool), or tool and workpiece about the feed (table).
    links
        Include the flexible link sections of a planar robot's file; a robot in space always includes its links.
    speeds : rpm
        Lowest and highest spindle speed of the lobes, and their number.
    turns : deg
        Lowest and highest turn of the redundancy, and their number: a posture map at one speed.
    speed : rpm
        Spindle speed of the posture map.
    method
        Solver of the lobes.
    picture
        Picture of the lobes or of the posture map to write.
    depth : m
        Depth of a cut to mark in the picture of a posture map.
    learned
        File that `robot learn` wrote: lobes of the prediction from measured postures, with their band.

    Returns
    -------
    StabilityLobes or PostureMap
        Lobes with their status and warnings, or depth limits and postures over the turns.

    Raises
    ------
    InputError
        Neither speeds nor turns, options that exclude each other, or a posture that the robot does not reach.

    Examples
    --------
    ::

        $ millfrf robot lobes kuka_kr90_r3100 --cutting cut.toml --speeds 2000 4000 21 --max-depth 0.01 --out lobes.csv
    """
    if learned is not None and (turns is not None or links):
        raise InputError("--learned gives lobes in one posture: leave --turns and --links out")
    if turns is None and speeds is None:
        raise InputError("give --speeds LO HI N for lobes, or --turns LO HI N with --speed RPM for a posture map")
    process, warnings_of_cut = process_of(cutting)
    warnings_of_cut += check_depth(max_depth, process)
    case, place = read_robot(robot), cut_place(at, feed, turn, redundancy)
    files, table = files_among(robot, learned, cutting), None if out is None else Path(out)
    if turns is not None:
        postures = _posture_map(spatial(case), place, process, turns, speed, max_depth, redundancy)
        warnings = [*spatial(case).assumed, *warnings_of_cut, *([] if speed is None else check_speed(speed, process))]
        warn(warnings)
        if table is not None:
            stated = {"at": at, "feed": feed, "turn": turn, "redundancy": redundancy}
            made_of = origin("robot lobes", files, {"speed_rpm": speed, "depth_max_m": max_depth, "place": stated})
            _write_postures(table, postures, spatial(case), warnings, made_of)
        _show_postures(postures, max_depth, depth, redundancy, picture)
        return postures
    assert speeds is not None
    driven, axes = posture_of(case, pose, joints, place)
    if learned is not None and table is not None:
        refuse_replacing(band_path(table))  # before the long computation
    problem = _LobesProblem(process, speed_axis(*speeds), max_depth, method)
    solved = (
        problem.of_robot(case, driven, axes, links)
        if learned is None
        else problem.of_learned(spatial(case), learned, driven, axes)
    )
    warnings_of_cut += check_speeds(speeds, process, solved.lowest_mode)
    solved = replace(solved, lobes=replace(solved.lobes, warnings=(*warnings_of_cut, *solved.lobes.warnings)))
    if table is not None:
        options = {"speeds_rpm": speeds, "depth_max_m": max_depth, "method": method, "links": links}
        options |= {"posture": shown_values(mechanism_of(case), driven), "mode_coupling": solved.coupling}
        _write_lobes(table, solved, files, options)
    warn(solved.lobes.warnings)
    _show_lobes(solved, max_depth, table, picture)
    return solved.lobes


@dataclass(frozen=True)
class _Solved:
    """Lobes, their 95 % band, a sentence on mode coupling (empty: not computed), and the lowest mode (Hz)."""

    lobes: StabilityLobes
    band: LimitBand | DepthBand | None
    coupling: str
    lowest_mode: float | None


@dataclass(frozen=True)
class _LobesProblem:
    """Cut, spindle speeds (rad/s), largest depth (m) and solver of lobes."""

    process: MillingProcess
    speeds: Real
    max_depth: float
    method: LobeMethod

    def of_robot(self, case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, links: bool) -> _Solved:
        """Lobes of the robot's own model."""
        result = in_posture(case, driven, axes, links=links)
        model = result.known_model()
        lobes, band, coupling = lobes_at_the_tip(model, self.process, self.speeds, self.max_depth, self.method)
        lobes = replace(lobes, warnings=(*result.warnings, *lobes.warnings))
        return _Solved(lobes, band, coupling, lowest_frequency(model.natural_frequencies))

    def of_learned(self, case: SpatialCase, learned: File, driven: Real, axes: Real | None) -> _Solved:
        """Lobes of the mean of a prediction from learned postures, and the band of its samples."""
        predicted = predicted_posture(case, learned, driven, axes)
        lobes = compute_lobes(predicted.model, self.process, self.speeds, self.max_depth, self.method)
        lobes = replace(lobes, warnings=(*predicted.warnings, *lobes.warnings))
        with progress("band of the depth limit", LOBES.samples) as update:
            band = depth_band(predicted.draws, self.process, self.speeds, self.max_depth, progress=update)
        return _Solved(lobes, band, "", lowest_frequency(predicted.model.natural_frequencies))


def _write_lobes(table: Path, solved: _Solved, files: Sequence[Path], options: dict[str, Any]) -> None:
    """Write the table of lobes, and the table of their band in the same folder."""
    lobes, band, place = solved.lobes, solved.band, band_path(table)
    if band is not None:
        refuse_replacing(place)
    write_lobes(table, lobes, provenance=made("robot lobes", files, options))
    if isinstance(band, LimitBand):
        write_band(place, band, origin("robot lobes", files, options))
    elif band is not None:
        write_depth_band(place, band, lobes.warnings, origin("robot lobes", files, options))


def _show_lobes(solved: _Solved, max_depth: float, table: Path | None, picture: File | None) -> None:
    """Print the lobes, and draw them into a picture."""
    lobes, band, coupling = solved.lobes, solved.band, solved.coupling
    judged = {"mode_coupling": coupling} if coupling else {}
    tell(lambda: {"max_depth_m": max_depth, **judged, **lobes_answer(lobes)})
    if coupling:
        say(coupling)
    if table is not None:
        say_written([table], lobes_summary(lobes, max_depth))
        if band is not None:
            say_written([band_path(table)], _band_in_words(band))
    if picture is None:
        return
    if isinstance(band, DepthBand):
        figure = depth_band_figure(band, lobes)
    else:
        shown = None if band is None else LobesBand(band.spindle_speeds / RPM, band.low, band.high)
        figure = lobes_figure({lobes.method: lobes}, band=shown)
    save_figure(figure, picture)
    say_written([picture])


def _band_in_words(band: LimitBand | DepthBand) -> str:
    if isinstance(band, LimitBand):
        return "95 % intervals from the update's covariance"
    lowest = int(np.argmin(band.low))
    return (
        f"at {band.spindle_speeds[lowest] / RPM:.0f} rpm the limit lies between {1e3 * band.low[lowest]:.3g} and "
        f"{1e3 * band.high[lowest]:.3g} mm (95 %)"
    )


def _posture_map(
    case: SpatialCase,
    place: CutPlace | None,
    process: MillingProcess,
    turns: tuple[float, float, int],
    speed: float | None,
    max_depth: float,
    redundancy: Turning,
) -> PostureMap:
    """Compute the depth limit over the redundancy angle (deg) at one place and speed (rpm)."""
    if speed is None:
        raise InputError("a posture map is at one spindle speed: give --speed RPM")
    if place is None:
        raise InputError("give the place of the tool tip: --at X Y Z, in metres")
    if turns[2] < 1:
        raise InputError(f"--turns {turns[0]:g} {turns[1]:g} {turns[2]}: give 1 angle or more")
    angles = np.radians(np.linspace(*turns))
    with progress("posture map"):
        return depth_over_redundancy(case.robot, place, angles, process, speed * RPM, max_depth, redundancy)


def _write_postures(
    table: Path, postures: PostureMap, case: SpatialCase, warnings: Sequence[str], made_of: dict[str, Any]
) -> None:
    """Write a posture map, and print its best angle."""
    mechanism, best = case.robot.mechanism, postures.best()
    sliding = [mechanism.frames[index].motion == "prismatic" for index in mechanism.moving]
    columns, rows = posture_table(postures, sliding)
    write_csv(table, columns, rows, warnings=warnings, provenance=made_of)
    say_written(
        [table],
        f"{postures.reached.sum()} of {len(postures.angles)} angles reached; best {1e3 * postures.values[best]:.3g} mm "
        f"at {np.degrees(postures.angles[best]):.1f} deg, worst {1e3 * np.nanmin(postures.values):.3g} mm",
    )


def _show_postures(
    postures: PostureMap, max_depth: float, depth: float | None, redundancy: Turning, picture: File | None
) -> None:
    """Count the angles at which a cut of ``depth`` (m) is stable, and draw the map into a picture."""
    if depth is not None:
        stable = postures.reached & (postures.values > depth)
        say(f"a cut of {1e3 * depth:g} mm is stable at {stable.sum()} of {postures.reached.sum()} angles")
    if picture is not None:
        what = "the robot about the tool" if redundancy == "tool" else "tool and table about the feed"
        save_figure(posture_figure(postures, max_depth, depth, what), picture)
        say_written([picture])
