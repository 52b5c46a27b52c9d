"""Common steps of the robot commands: read, compute, print a table, write a file."""

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import write_frf
from millfrf.core import InputError, writing_whole_file
from millfrf.figures import save_figure
from millfrf.robot_model import (
    PostureResult,
    SpatialRobot,
    ToolPath,
    cell_structure_at,
    close_loops,
    compensate_path,
    in_posture,
    read_robot,
    read_tool_path,
    shown_values,
    write_compensated_path,
)
from modal_fit import write_modal_model

from ..answers import model_answer
from ..options import check_band, check_output
from ..progress import bar
from ..provenance import add_comment, add_to_json, origin
from ..tables import Table, show
from ..terminal import say, tell
from .asked_loads import Loads, check_near, check_positive
from .postures import Asked, mechanism_of, posture_of, spatial, start_of_path
from .update_bands import deviation_sentence, with_errors

Real = NDArray[np.float64]

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
        from .picture import draw_modes

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
    from .shown import receptance_figure, write_receptance_table

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
        from .compensation_figure import draw_compensation

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
