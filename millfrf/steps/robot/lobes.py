"""Lobes of a robot's posture, and depth limits over its redundancy, from the command line."""

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from millfrf.core import TIP, InputError, refuse_replacing, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, made, origin
from millfrf.core.terminal import say, tell
from millfrf.cutting import MillingProcess
from millfrf.figures import LobesBand, lobes_figure, save_figure
from millfrf.gate import check_depth, check_speed, check_speeds, lowest_frequency, read_checked_cutting
from millfrf.options import check_output
from millfrf.robot_model import SpatialCase, in_posture, read_robot, shown_values
from millfrf.stability import StabilityLobes, judge_mode_coupling, with_residual_flexibility, write_lobes
from modal_fit import ModalModel, Residuals

from ..answers import lobes_answer
from ..lobes import compute_lobes, lobes_summary, speed_axis
from .common import RPM, band_beside, band_of_lobes, say_doubts, settled_modes, write_band
from .maps import depth_over_redundancy, write_posture_map
from .postures import Asked, cut_place, mechanism_of, posture_of, spatial

_TIME_PERIODIC = ("certified", "collocation", "semi-discretization")
"""Methods whose cost grows with the highest mode."""


def at_the_tip(model: ModalModel) -> ModalModel:
    """The model over X, Y and Z of the tip; a direction that it does not have (Y of a planar robot) is rigid."""
    if model.responses == TIP:
        return model
    places = [model.responses.index(label) if label in model.responses else -1 for label in TIP]

    def picked(vectors: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros(len(vectors)) if i < 0 else vectors[:, i] for i in places])

    known, residuals = with_residual_flexibility(model).residuals, None
    if known is not None:
        upper, lower = (picked(picked(part).T).T for part in (known.upper, known.lower))
        residuals = Residuals(upper, lower)
    return ModalModel(model.poles, picked(model.right), picked(model.left), TIP, TIP, residuals=residuals)


def write_lobes_in_posture(
    robot: str,
    asked: Asked,
    cutting: Path,
    speeds: tuple[float, float, int] | None,
    max_depth: float,
    method: str,
    out: Path,
    picture: Path | None = None,
    links: bool = False,
) -> None:
    """Lobes of one posture, in the axes of the cut; ``links``: a planar robot's link sections count too."""
    check_output(out, (".csv",))
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".svg"))
    if speeds is None:
        raise InputError("give --speeds LO HI N for lobes, or --turns LO HI N with --speed RPM for a posture map")
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes, links=links)
    process, doubts = read_checked_cutting(cutting)
    doubts += check_depth(max_depth, process)
    doubts += check_speeds(speeds, process, lowest_frequency(result.known_model().natural_frequencies))
    model = at_the_tip(result.known_model())
    filed = model
    told: tuple[str, ...] = ()
    if method in _TIME_PERIODIC:
        model, told = settled_modes(model, process, speed_axis(*speeds), max_depth)
    found = compute_lobes(model, process, speed_axis(*speeds), max_depth, method, bar)
    band, doubt = band_of_lobes(filed, process, found, max_depth)
    doubts += [doubt] if doubt else []
    found = replace(found, warnings=(*doubts, *result.warnings, *told, *found.warnings))
    coupling = _coupling(model, process, found, max_depth)
    asked_for: dict[str, object] = {"speeds_rpm": speeds, "depth_max_m": max_depth, "method": method, "links": links}
    asked_for["posture"] = shown_values(mechanism_of(case), driven)
    asked_for["mode_coupling"] = coupling
    if band is not None:
        refuse_replacing(band_beside(out))
    write_lobes(out, found, provenance=made("robot lobes", [robot, cutting], asked_for))
    for warning in found.warnings:
        say(f"warning: {warning}")
    say(coupling)
    tell(lambda: {"max_depth_m": max_depth, "mode_coupling": coupling, **lobes_answer(found)})
    say(f"wrote {out}: {lobes_summary(found, max_depth)}")
    if band is not None:
        say(f"wrote {write_band(out, band)}: 95 % intervals from the update's covariance")
    if picture is not None:
        shown = None if band is None else LobesBand(band.spindle_speeds / RPM, band.low, band.high)
        save_figure(lobes_figure({found.method: found}, band=shown), picture)
        say(f"wrote {picture}")


def _sliding(case: SpatialCase) -> list[bool]:
    """Which moving joints are prismatic."""
    mechanism = case.robot.mechanism
    return [mechanism.frames[index].motion == "prismatic" for index in mechanism.moving]


def _coupling(model: ModalModel, process: MillingProcess, found: StabilityLobes, max_depth: float) -> str:
    """Whether mode coupling decides, at the speed of the lowest limit, and its ground."""
    if not np.isfinite(found.depth_limits).any():
        return "mode coupling is not judged: no speed has a limit"
    lowest = int(np.nanargmin(np.where(np.isfinite(found.depth_limits), found.depth_limits, np.nan)))
    return judge_mode_coupling(model, process, float(found.spindle_speeds[lowest]), max_depth).words


def write_map_over_redundancy(
    robot: str,
    asked: Asked,
    cutting: Path,
    angles: tuple[float, float, int],
    speed: float | None,
    max_depth: float,
    out: Path,
    drawn: tuple[Path | None, float | None] = (None, None),
) -> None:
    """Depth limit over the redundancy angle, and the best posture; ``drawn``: a picture, and a depth in it, m."""
    check_output(out, (".csv",))
    picture, depth = drawn
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".svg"))
    if depth is not None and not depth > 0:
        raise InputError(f"--depth {depth!r} m must be positive")
    if speed is None or not speed > 0:
        raise InputError("a posture map is at one spindle speed: give --speed RPM")
    if angles[2] < 1 or not max_depth > 0:
        raise InputError(f"{angles[2]} angles up to a depth of {max_depth!r} m: both must be positive")
    case = spatial(read_robot(robot))
    process, doubts = read_checked_cutting(cutting)
    doubts = [*case.assumed, *doubts]
    doubts += [*check_depth(max_depth, process), *check_speed(speed, process)]
    say_doubts(doubts)
    axis = np.radians(np.linspace(*angles))
    with bar("posture map"):
        found = depth_over_redundancy(
            case.robot, cut_place(asked), axis, process, speed * RPM, max_depth, asked.redundancy
        )
    best = found.best()
    with writing_whole_file(out) as unfinished:
        write_posture_map(unfinished, found, doubts, _sliding(case))
        asked_for = {"speed_rpm": speed, "depth_max_m": max_depth, "place": asdict(asked)}
        add_comment(unfinished, origin("robot lobes", [robot, cutting], asked_for))
    say(
        f"wrote {out}: {found.reached.sum()} of {len(axis)} angles reached; best {1e3 * found.values[best]:.3g} mm at "
        f"{np.degrees(axis[best]):.1f} deg, worst {1e3 * np.nanmin(found.values):.3g} mm"
    )
    if depth is not None:
        stable = found.reached & (found.values > depth)
        say(f"a cut of {1e3 * depth:g} mm is stable at {stable.sum()} of {found.reached.sum()} angles")
    if picture is not None:
        from .pictures import draw_posture_map

        what = "the robot about the tool" if asked.redundancy == "tool" else "tool and table about the feed"
        draw_posture_map(picture, found, max_depth, depth, what)
        say(f"wrote {picture}")
