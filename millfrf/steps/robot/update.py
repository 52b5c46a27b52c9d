"""Step ``robot update``: fit the numbers of a robot's file to measurements."""

import json
import math
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from estimation import Frf, is_uff_number, read_frf, read_frf_uff
from millfrf.core import FileFormatError, InputError, MillfrfError, Real, with_error, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_comment, add_to_json, origin, read_provenance
from millfrf.core.steps import Band, File, Reads, Writes, step
from millfrf.core.terminal import say, say_written, silently, tell
from millfrf.gate import FileKind, kind_of
from millfrf.robot_model import (
    Mechanism,
    PosedReceptance,
    RobotUpdate,
    UpdateParameter,
    close_loops,
    measured_frf,
    measured_model,
    numbered_robot_text,
    read_robot,
    shown_values,
    updated_document,
)
from millfrf.robot_model import update_robot as update_model
from modal_fit import read_modal_model

from ..estimate import estimate
from ..given import Degrees, NearTip, Poses, Robot
from ..settings import ROBOT_STEPS
from .postures import axes_turned, band_of_modes, driven_of_each, spatial


@step
def update_robot(
    robot: Robot,
    /,
    *measurements: Annotated[File, Reads("FILE")],
    poses: Poses = (),
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
    report: Annotated[File | None, Writes(suffixes=(".json",))] = None,
    channels_turned: Degrees | None = None,
    band: Band | None = None,
    sensor_at: NearTip = None,
    stream: str | None = None,
) -> RobotUpdate:
    """Fit all numbers of a robot to measurements, name those that are wrong, and write the updated file.

    Joint stiffnesses and dampings, links, payload and tool mass, compliance of tool, tip and base are fitted together.
    The file is written only if the updated robot predicts postures better that were left out of its update.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    measurements
        Recordings, FRFs (.h5, .uff) or modal models (.json).
    poses
        Posture of each file in turn: a name of the robot's file, or DEG,DEG,...
    out
        Updated robot file to write.
    report
        File of all numbers, errors and directions to write.
    channels_turned : deg
        Angle of channel X from the base's x, with Z up; without it the axes of the base.
    band : Hz
        Band that is compared; without it 0.4 times the first to 1.3 times the sixth natural frequency.
    sensor_at : m
        Place of the housing sensor from the tip, in the channels' axes.
    stream
        Sample clock of recordings; needed where one has several.

    Returns
    -------
    RobotUpdate
        Verdict, numbers with their covariance, errors held out, and the posture to measure next.

    Raises
    ------
    InputError
        Another number of postures than of files, or files that cannot be used together.
    MillfrfError
        No update explains the measurements: only the report is written, no robot file.

    Examples
    --------
    ::

        $ millfrf robot update robot.toml a.h5 b.json --pose home --pose 0,-10,100,0,90,0 --out new.toml
    """
    case = spatial(read_robot(robot))
    paths = [Path(file) for file in measurements]
    driven = driven_of_each(case, poses, len(paths), "files")
    postures = [close_loops(case.robot.mechanism, values) for values in driven]
    band = band or band_of_modes(case.robot, postures, n_modes=6)
    axes, sensor = axes_turned(channels_turned), None if sensor_at is None else np.array(sensor_at)
    measured = [_read(path, q, band, axes, sensor, stream) for path, q in zip(paths, postures, strict=True)]
    with progress("updating"):
        update = update_model(case.robot, measured, case.poses)
    tell(lambda: {"update": as_json(update)})
    for line in summary(update, case.robot.mechanism):
        say(line)
    options = {"poses": poses, "channels_turned_deg": channels_turned, "band_hz": band, "sensor_at_m": sensor_at}
    made_of = origin("robot update", [robot, *paths], {**options, "stream": stream})
    if report is not None:
        with writing_whole_file(report) as unfinished:
            unfinished.write_text(json.dumps(as_json(update), indent=1), encoding="utf-8")
            add_to_json(unfinished, made_of)
        say_written([report])
    if out is not None:
        if update.verdict == "unexplained":
            raise MillfrfError(f"{out} was not written: {update.reason}")
        with writing_whole_file(out) as unfinished:
            document = updated_document(numbered_robot_text(robot), case.robot, update)
            unfinished.write_text(document, encoding="utf-8")
            add_comment(unfinished, made_of)
            _check_readable(unfinished, Path(out))
        say_written([out], f"the robot's file with {len(update.parameters)} numbers updated and their covariance")
    return update


def _read(
    path: Path, q: Real, band: tuple[float, float], axes: Real, sensor: Real | None, stream: str | None
) -> PosedReceptance:
    """Read a recording, an FRF or a modal model that was measured in the posture with the joint values q."""
    if path.suffix.lower() in (".uff", ".unv", ".uf"):
        return measured_frf(_from_uff(path), path.name, q, band, axes=axes, sensor=sensor)
    kind = kind_of(path)
    if kind == FileKind.MODEL:
        return measured_model(read_modal_model(path), path.name, q, band, axes=axes, sensor=sensor)
    if kind == FileKind.FRF:
        frf = read_frf(path)
        return measured_frf(frf, path.name, q, band, axes=axes, sensor=sensor, window=_window(path, frf))
    if kind == FileKind.RECORDING:
        with silently():
            frf = estimate(path, estimator="local-polynomial", band=band, stream=stream).frf
        return measured_frf(frf, path.name, q, band, axes=axes, sensor=sensor)
    raise FileFormatError(f"{path} is {kind}; an update takes recordings, FRFs and modal models")


def _from_uff(path: Path) -> Frf:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    frf = read_frf_uff(path)
    numbered = [label for label in (*frf.responses, *frf.excitations) if is_uff_number(label.split(":")[0])]
    if numbered:
        raise InputError(
            f"{path.name}: nodes are numbers ({numbered[0]}); name them TCP and HOUSING with "
            "'millfrf convert IN OUT --map MAP.toml'"
        )
    return frf


def _window(path: Path, frf: Frf) -> Real | None:
    """Return the weights by which a Hann window averages an FRF from ``millfrf estimate``; None for other FRFs.

    The weights belong to half lines. The cross spectrum of windowed segments shows the FRF averaged over
    ``|W(f - f')|^2``. The inverse transform of this average lasts two segments, so half lines represent it exactly
    (Bendat & Piersol, Random Data, section 11.6).
    """
    options = read_provenance(path).get("options", {})
    segmented = options.get("estimator") in ("h1", "h2", "hv") and options.get("window") == "hann"
    steps = np.diff(frf.frequencies)
    if not segmented or len(steps) < 2 or abs(float(options.get("segment", 0.0)) * steps.min() - 1) > 0.01:
        return None
    bins = np.arange(-(ROBOT_STEPS.window_taps // 2), ROBOT_STEPS.window_taps // 2 + 1) / 2
    line = np.sinc(bins) + 0.5 * (np.sinc(bins - 1) + np.sinc(bins + 1))
    return np.asarray(line**2 / np.sum(line**2))


UNITS = {"m/N": ("µm/N", 1e6), "rad/(N m)": ("µrad/(N m)", 1e6), "kg": ("kg", 1.0), "m": ("m", 1.0)}
FORMAT = "millfrf.robot_update"


def summary(update: RobotUpdate, mechanism: Mechanism) -> list[str]:
    """Lines for the terminal: verdict, numbers, held-out errors, open directions, next measurement."""
    lines = [f"verdict: {update.verdict}", update.reason]
    numbers = list(zip(update.parameters, update.x, update.errors, update.named, update.determined, strict=True))
    lines += [f"wrong in the file: {_number(number, x, error)}" for number, x, error, named, _ in numbers if named]
    others = [_number(number, x, error) for number, x, error, named, known in numbers if known and not named]
    if update.verdict != "unexplained":
        lines += [f"updated, not named: {text}" for text in others]
    lines += [
        f"error on {error.name}, left out: {error.before:.3g} times the noise as filed, {error.after:.3g} updated"
        for error in update.held_out
    ]
    if update.modes_off:
        lines.append(f"modes are still off by {100 * update.modes_off:.2g} % in frequency, beyond the noise")
    lines += [direction.sentence for direction in update.open]
    if update.next is not None:
        lines.append(_next(update, mechanism))
    return lines


def _number(parameter: UpdateParameter, x: float, error: float) -> str:
    """Format a number with its standard error in common units; convert a logarithm to a factor."""
    if parameter.logarithmic:
        return f"{parameter.name}: times {with_error(math.exp(x), math.exp(x) * error)}"
    unit, factor = UNITS.get(parameter.unit, (parameter.unit, 1.0))
    return f"{parameter.name}: {with_error(factor * x, factor * error, sign=True)} {unit}".rstrip()


def _next(update: RobotUpdate, mechanism: Mechanism) -> str:
    assert update.next is not None
    where = update.next.name or shown_values(mechanism, update.next.driven)
    what = ", ".join(f"{name} to {100 * left:.0f} %" for name, left in update.next.sharpens)
    gains = f"; errors fall: {what}" if what else ""
    return f"measure next: {where} ({update.next.gain:.2g} nats{gains}); check first that the robot may stand there"


def as_json(update: RobotUpdate) -> dict[str, Any]:
    """An update as JSON: verdict, numbers, covariance, held-out errors, open directions, next posture."""
    numbers = [
        {
            "name": parameter.name,
            "kind": parameter.kind,
            "unit": parameter.unit,
            "logarithm_of_factor": parameter.logarithmic,
            "value": float(x),
            "standard_error": float(error),
            "told": bool(known),
            "named": bool(named),
        }
        for parameter, x, error, known, named in zip(
            update.parameters, update.x, update.errors, update.determined, update.named, strict=True
        )
    ]
    following = update.next
    return {
        "format": FORMAT,
        "format_version": 1,
        "verdict": update.verdict,
        "reason": update.reason,
        "numbers": numbers,
        "covariance": np.asarray(update.covariance).tolist(),
        "held_out": [{"name": each.name, "before": each.before, "after": each.after} for each in update.held_out],
        "fitted": update.fitted.tolist(),
        "noise": update.noise,
        "modes_off": update.modes_off,
        "open": [{"names": each.names, "parts": each.parts, "left": each.left} for each in update.open],
        "next": None
        if following is None
        else {"name": following.name, "driven": following.driven.tolist(), "gain_nats": following.gain},
    }


def _check_readable(unfinished: Path, out: Path) -> None:
    """Read the new file before it replaces the old file, because fitted numbers may be impossible for a robot."""
    try:
        read_robot(unfinished)
    except MillfrfError as error:
        why = str(error).replace(f"{unfinished}: ", "")
        raise MillfrfError(
            f"{out} was not written, since no robot has these numbers: {why}; check posture, axes and band"
        ) from error
