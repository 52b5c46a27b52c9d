"""Parts that the robot steps share: reading, tables, files, loads."""

import csv
import json
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Frf, write_frf
from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, add_to_json, origin
from millfrf.core.terminal import Table, say, show, tell
from millfrf.cutting import MillingProcess
from millfrf.figures import save_figure
from millfrf.options import check_band, check_output
from millfrf.robot_model import (
    PostureResult,
    SpatialCase,
    SpatialRobot,
    ToolPath,
    cell_structure_at,
    close_loops,
    compensate_path,
    derived_errors,
    frf_with_errors,
    in_posture,
    modal_model_at,
    modes_at,
    read_robot,
    read_tool_path,
    shown_values,
    write_compensated_path,
)
from millfrf.stability import LimitBand, StabilityLobes, certified_lobes, limit_band, with_static_high_modes
from modal_fit import ModalModel, write_modal_model

from ..answers import model_answer
from .postures import Asked, Loads, check_near, check_positive, mechanism_of, posture_of, spatial, start_of_path

MOST_TURNS = 20.0
"""Turns of the highest mode in the longest tooth period that are computed without asking for fewer."""

SETTLED = 5e-3
"""Relative change of the limits that counts as none."""

_COUNTS = (8, 11, 15, 20, 27, 36, 48)


def settled_modes(
    model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float
) -> tuple[ModalModel, tuple[str, ...]]:
    """Leave high modes as their static flexibility where three speeds show that this changes no limit by 0.5 %.

    A model whose modes turn at most 20 times in the longest tooth period comes back as it is. Else the limits at the
    slowest, a middle and the fastest speed are computed with all modes up to 20 turns, and the fewest are taken that
    give the same; the warning says how many, and by how much limits moved.

    Parameters
    ----------
    model
        Modal model over TCP X, Y, Z.
    process
        Cutter and engagement.
    speeds : (n_speeds,), rad/s
        Spindle speeds of the lobes.
    max_depth : m
        Largest depth that is searched.
    """
    natural = np.sort(model.natural_frequencies)
    most = MOST_TURNS * process.teeth * float(speeds.min()) / (2 * np.pi)
    if natural[-1] <= most or not process.is_plain:
        return model, ()
    steps = [float(natural[count - 1]) * 1.0001 for count in _COUNTS if count < len(natural)]
    steps = [step for step in steps if step <= most] + [max(most, steps[0] if steps else 0.0)]
    checked = np.unique([speeds.min(), speeds[len(speeds) // 2], speeds.max()])
    truth = _limits(with_static_high_modes(model, steps[-1]), process, checked, max_depth)
    for step in steps:
        small = with_static_high_modes(model, step)
        change = float(np.abs(_limits(small, process, checked, max_depth) / truth - 1).max())
        if change < SETTLED:
            break
    words = (
        f"{len(model.poles) - len(small.poles)} modes above {step:.0f} Hz are left as their static flexibility: at "
        f"{len(checked)} speeds, limits with modes up to {steps[-1]:.0f} Hz differ by at most {100 * change:.2g} %"
    )
    return small, (words,)


def _limits(model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float) -> Real:
    found = certified_lobes(model, process, speeds, max_depth).depth_limits
    return np.maximum(np.minimum(np.nan_to_num(found, nan=0.0, posinf=max_depth), max_depth), 1e-9)


WIDE = 1.96
"""Standard errors of half a 95 % interval."""


def with_errors(frf: Frf, case: object, driven: Real, axes: Real | None) -> Frf:
    """The FRF with the covariance that an update left; as it is where the file was never updated."""
    if not isinstance(case, SpatialCase) or case.uncertainty is None:
        return frf
    q = close_loops(case.robot.mechanism, driven)

    def values(robot: SpatialRobot) -> Real:
        found = modal_model_at(robot, q, axes=axes).receptance(frf.frequencies)
        return np.stack([found.real, found.imag])

    errors = derived_errors(case.robot, case.uncertainty, values)
    return frf_with_errors(frf, np.sqrt(np.sum(errors**2, axis=0)))


def band_of_lobes(
    model: ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> tuple[LimitBand | None, str]:
    """95 % interval of certified limits, and a sentence where there is none; both empty without a covariance."""
    if model.covariance is None:
        return None, ""
    try:
        return limit_band(model, process, lobes, 1.5 * max_depth), ""
    except InputError as error:
        return None, f"the update's covariance gives no band of these lobes: {error}"


def band_beside(out: Path) -> Path:
    """Place of a band beside a table of lobes."""
    return out.with_name(f"{out.stem}_band.csv")


def write_band(out: Path, band: LimitBand) -> Path:
    """Write the band beside the lobes: ``<lobes>_band.csv`` with speed (rpm), both ends (m) and how they were found."""
    place = band_beside(out)
    with writing_whole_file(place) as unfinished, unfinished.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["spindle_speed_rpm", "depth_limit_low_m", "depth_limit_high_m", "basis"])
        rpm = band.spindle_speeds * 30 / np.pi
        for speed, low, high, basis in zip(rpm, band.low, band.high, band.basis, strict=True):
            writer.writerow([f"{speed:.9g}", f"{low:.9g}", f"{high:.9g}", basis])
    return place


def frequency_errors(case: SpatialCase, postures: Sequence[Real | None]) -> Real | None:
    """Standard errors of the lowest natural frequency in postures, (n,), Hz; None where the file was never updated.

    NaN where there is no posture.
    """
    if case.uncertainty is None:
        return None
    reached = [q for q in postures if q is not None]

    def lowest(robot: SpatialRobot) -> Real:
        return np.array([modes_at(robot, q).frequencies[0] for q in reached])

    errors = np.full(len(postures), np.nan)
    errors[[q is not None for q in postures]] = derived_errors(case.robot, case.uncertainty, lowest)
    return errors


def frequency_sentence(errors: Real) -> str:
    """How far the update leaves the lowest frequency open, in a sentence."""
    return (
        f"the update leaves the lowest frequency open by ±{WIDE * np.nanmedian(errors):.2g} Hz in the median and "
        f"±{WIDE * np.nanmax(errors):.2g} Hz at most (95 %)"
    )


def deviation_sentence(case: SpatialCase, deviations: Callable[[SpatialRobot], Real]) -> str:
    """How far the update leaves deviations (n, 6) open, in a sentence; empty where the file was never updated."""
    if case.uncertainty is None:
        return ""
    errors = 1e3 * np.linalg.norm(derived_errors(case.robot, case.uncertainty, deviations)[:, :3], axis=1)
    return (
        f"the update leaves the deviation open by ±{WIDE * np.nanmedian(errors):.3g} mm in the median and "
        f"±{WIDE * np.nanmax(errors):.3g} mm at most (95 %)"
    )


RPM = np.pi / 30


def show_modes(robot: str, asked: Asked, count: int, picture: Path | None, links: bool = False) -> None:
    """Table of modes; a picture or a page where asked."""
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".html"))
    if count < 1:
        raise InputError(f"--modes {count}: give 1 or more modes")
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes, links=links)
    model = result.known_model()
    kept = {f"{f:.6f}": f"{100 * z:.2f}" for f, z in zip(model.natural_frequencies, model.damping_ratios, strict=True)}
    shown = [(f, kept.get(f"{f:.6f}", "overdamped")) for f in result.frequencies[:count]]
    rows = tuple((str(i + 1), f"{f:.3f}", ratio) for i, (f, ratio) in enumerate(shown))
    posture = shown_values(mechanism_of(case), driven)
    title = f"Modes in the posture {posture}"
    tell(lambda: _modes_told(result, posture, count))
    show(Table(title, ("mode", "frequency (Hz)", "damping ratio (%)"), rows))
    warn(result)
    if picture is not None:
        from .pictures import draw_modes

        draw_modes(picture, spatial(case), driven)
        say(f"wrote {picture}")


def _modes_told(result: PostureResult, posture: str, count: int) -> dict[str, Any]:
    """Natural frequencies and damping in a posture for a script; overdamped modes have no ratio."""
    model = result.known_model()
    ratios = dict(zip(model.natural_frequencies.round(6), model.damping_ratios, strict=True))
    modes = [{"frequency_hz": f, "damping_ratio": ratios.get(round(f, 6))} for f in result.frequencies[:count]]
    return {"posture": posture, "modes": modes}


def write_receptance(
    robot: str,
    asked: Asked,
    out: Path,
    band: tuple[float, float],
    lines: int,
    sensor: tuple[float, float, float] | None = None,
    links: bool = False,
    drawn: tuple[Path | None, Path | None] = (None, None),
) -> None:
    """FRF or modal model at the tool tip; with a sensor, the housing's motion too; ``drawn``: a picture, a table."""
    check_drawn(drawn, out)
    check_output(out, (".json",) if sensor is not None else (".h5", ".json"))
    check_band(band)
    check_positive("band", band[1], "Hz", 1e6)
    if not 2 <= lines <= 1_000_000:
        raise InputError(f"{lines} frequency lines: give 2 to 1000000")
    case = read_robot(robot)
    driven, axes = posture_of(case, asked)
    result = in_posture(case, driven, axes, links=links)
    model = result.known_model()
    if sensor is not None:
        check_near("sensor-at", sensor)
        model = cell_structure_at(spatial(case).robot, driven, np.array(sensor), axes=axes)
    provenance = {
        "command": "robot frf",
        "robot": robot,
        "posture": shown_values(mechanism_of(case), driven),
        "warnings": list(result.warnings),
        **origin("robot frf", [robot]),
    }
    if out.suffix == ".json":
        with writing_whole_file(out) as temporary:
            write_modal_model(temporary, model)
            add_to_json(temporary, provenance)
    else:
        frf = with_errors(model.frf(np.linspace(*band, lines)), case, driven, axes)
        write_frf(out, frf, provenance=json.dumps(provenance))
    told = origin("robot frf", [robot], {"posture": provenance["posture"]})
    _draw_receptance(result, np.linspace(*band, lines), drawn, told)
    warn(result)
    tell(lambda: {"posture": provenance["posture"], **model_answer(model)})
    say(f"wrote {out}: {len(model.poles)} modes from {model.natural_frequencies.min():.2f} Hz")


def check_drawn(drawn: tuple[Path | None, Path | None], out: Path | None = None) -> None:
    """Refuse names of a picture or a table that cannot be written, or that are the output itself.

    Raises
    ------
    InputError
        Another suffix, or one name twice.
    """
    for path, suffixes in zip(drawn, ((".png", ".pdf", ".svg"), (".csv",)), strict=True):
        if path is not None:
            check_output(path, suffixes, [] if out is None else [out])


def _draw_receptance(
    result: PostureResult, frequencies: Real, drawn: tuple[Path | None, Path | None], stated: dict[str, Any]
) -> None:
    """Picture and table of the receptance at the tip, where they were asked for."""
    from .pictures import receptance_figure, write_receptance_table

    picture, table = drawn
    frf = result.known_model().frf(frequencies)
    if picture is not None:
        save_figure(receptance_figure(frf, result.frequencies), picture)
        say(f"wrote {picture}")
    if table is not None:
        write_receptance_table(table, frf, result.warnings, stated)
        say(f"wrote {table}")


def write_compensation(
    robot: str, path: Path, asked: Asked, out: Path, loads: Loads, picture: Path | None = None
) -> None:
    """Corrected path, and what it is worth."""
    check_output(out, (".csv",), [path])
    if picture is not None:
        check_output(picture, (".png", ".pdf", ".svg"))
    case = spatial(read_robot(robot))
    say_doubts(case.assumed)
    start = posture_of(case, asked)[0]
    close_loops(case.robot.mechanism, start)
    nominal = read_tool_path(path)
    if asked.pose is None and asked.joints is None:  # the file's first posture may be on a branch beyond the limits
        start = start_of_path(case.robot, nominal, start)
    with bar("compensating"):
        result = compensate_path(case.robot, nominal, start, payload=loads.payload, weight=loads.weight)
        left_open = deviation_sentence(case, partial(_deviations, nominal, start, loads))
    with writing_whole_file(out) as unfinished:
        write_compensated_path(unfinished, result)
        add_comment(unfinished, origin("robot compensate", [robot, path], {"payload_and_weight": loads}))
    if picture is not None:
        from .pictures import draw_compensation

        draw_compensation(picture, nominal, result)
        say(f"wrote {picture}")
    before, after, sag = (
        1e3 * np.linalg.norm(moved[:, :3], axis=1) for moved in (result.deviations, result.left, result.weight)
    )
    change = 1e3 * np.linalg.norm((result.weight - result.weight[0])[:, :3], axis=1)
    say(
        f"wrote {out}: predicted deviation mean {before.mean():.3f} mm, largest {before.max():.3f} mm; "
        f"after correction {1e3 * after.max():.2g} um by the same model"
    )
    counted = {
        "all": "all of it is corrected (--weight all)",
        "change": "only its change from the first place is corrected (--weight change)",
        "none": "none of it is corrected (--weight none)",
    }
    own = "the robot and" if case.robot.bodies else "the robot unknown (its file gives no bodies); of"
    say(
        f"weight of {own} a payload of {loads.payload.mass:g} kg: largest deflection {sag.max():.3f} mm, "
        f"changes by up to {change.max():.3f} mm from the first place; {counted[loads.weight]}"
    )
    if left_open:
        say(left_open)
    for warning in result.warnings:
        say(f"warning: {warning}")


def _deviations(path: ToolPath, start: np.ndarray, loads: Loads, robot: SpatialRobot) -> np.ndarray:
    return compensate_path(robot, path, start, payload=loads.payload, weight=loads.weight).deviations


def say_doubts(doubts: Sequence[str]) -> None:
    """Print doubts as warnings."""
    for doubt in doubts:
        say(f"warning: {doubt}")


def warn(result: PostureResult) -> None:
    """Print a posture's warnings."""
    for warning in result.warnings:
        say(f"warning: {warning}")
