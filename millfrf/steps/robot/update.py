"""Step ``robot update``: a robot file brought to what was measured."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Frf, is_uff_number, read_frf, read_frf_uff
from millfrf.core import FileFormatError, InputError, MillfrfError, Real, writing_whole_file
from millfrf.core.file_kinds import FRF, MODEL, RECORDING, kind_of
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, add_to_json, origin, read_provenance
from millfrf.core.terminal import say, tell
from millfrf.options import check_band, check_output
from millfrf.report.tables import with_error
from millfrf.robot_model import (
    Mechanism,
    PosedReceptance,
    RobotUpdate,
    SpatialCase,
    UpdateParameter,
    close_loops,
    measured_frf,
    measured_model,
    modes_at,
    numbered_robot_text,
    read_robot,
    shown_values,
    tool_down,
    update_robot,
    updated_document,
)
from modal_fit import read_modal_model

from ..estimate import estimate_recordings
from ..test_spectra import LOCAL, EstimateOptions
from .postures import Asked, posture_of, spatial


@dataclass(frozen=True)
class Asking:
    """Options of an update; None where left out.

    Parameters
    ----------
    poses
        Posture of each file: a name of the robot's file, or degrees with commas.
    feed
        Direction of channel X from the base's x, degrees, with Z up; None: the base's axes.
    band
        Lowest and highest frequency that are compared, Hz.
    sensor
        Housing sensor from the tip, m, in the channels' axes.
    stream
        Sample clock of recordings.
    """

    poses: tuple[str, ...]
    feed: float | None = None
    band: tuple[float, float] | None = None
    sensor: tuple[float, float, float] | None = None
    stream: str | None = None


LOWEST, HIGHEST = 0.4, 1.3
"""Band that is compared where none is given: from so many times the first mode to so many times the sixth."""

WINDOW_TAPS = 9
"""Half lines over which a Hann window averages an FRF: beyond them it weighs less than 0.1 %."""


def read_measured(case: SpatialCase, paths: Sequence[Path], asking: Asking) -> list[PosedReceptance]:
    """Read each file in its posture.

    Raises
    ------
    InputError
        Not one posture a file, files that are none of the three kinds, or degrees of freedom that a robot does not
        have.
    """
    if len(asking.poses) != len(paths):
        raise InputError(
            f"{len(asking.poses)} postures for {len(paths)} files; give --pose once for each, in the same order"
        )
    postures = [close_loops(case.robot.mechanism, _driven(case, pose)) for pose in asking.poses]
    band = check_band(asking.band) or _band(case, postures)
    axes = np.eye(3) if asking.feed is None else tool_down([0.0, 0.0, 0.0], np.radians(asking.feed)).axes
    sensor = None if asking.sensor is None else np.array(asking.sensor)
    return [_read(path, q, band, axes, sensor, asking.stream) for path, q in zip(paths, postures, strict=True)]


def _read(
    path: Path, q: Real, band: tuple[float, float], axes: Real, sensor: Real | None, stream: str | None
) -> PosedReceptance:
    if path.suffix.lower() in (".uff", ".unv", ".uf"):
        return measured_frf(_from_uff(path), path.name, q, band, axes=axes, sensor=sensor)
    kind = kind_of(path)
    if kind == MODEL:
        return measured_model(read_modal_model(path), path.name, q, band, axes=axes, sensor=sensor)
    if kind == FRF:
        frf = read_frf(path)
        return measured_frf(frf, path.name, q, band, axes=axes, sensor=sensor, window=_window(path, frf))
    if kind == RECORDING:
        options = EstimateOptions(estimator=LOCAL, band=band, stream=stream)
        frf = estimate_recordings([path], options, bar).frf
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
    """Weights of half lines of an FRF that ``millfrf estimate`` made with a Hann window; None for every other one.

    The cross spectrum of windowed segments shows the FRF averaged over ``|W(f - f')|^2``; its inverse transform reaches
    over two segments, so that half lines give it exactly (Bendat & Piersol, Random Data, section 11.6).
    """
    options = read_provenance(path).get("options", {})
    segmented = options.get("estimator") in ("h1", "h2", "hv") and options.get("window") == "hann"
    steps = np.diff(frf.frequencies)
    if not segmented or len(steps) < 2 or abs(float(options.get("segment", 0.0)) * steps.min() - 1) > 0.01:
        return None
    bins = np.arange(-(WINDOW_TAPS // 2), WINDOW_TAPS // 2 + 1) / 2
    line = np.sinc(bins) + 0.5 * (np.sinc(bins - 1) + np.sinc(bins + 1))
    return np.asarray(line**2 / np.sum(line**2))


def _driven(case: SpatialCase, pose: str) -> Real:
    asked = Asked(joints=pose) if "," in pose else Asked(pose=pose)
    return posture_of(case, asked)[0]


def _band(case: SpatialCase, postures: Sequence[Real]) -> tuple[float, float]:
    frequencies = [modes_at(case.robot, q).frequencies for q in postures]
    return (
        LOWEST * min(float(one[0]) for one in frequencies),
        HIGHEST * max(float(one[min(5, len(one) - 1)]) for one in frequencies),
    )


UNITS = {"m/N": ("µm/N", 1e6), "rad/(N m)": ("µrad/(N m)", 1e6), "kg": ("kg", 1.0), "m": ("m", 1.0)}
FORMAT = "millfrf.robot_update"


def summary(found: RobotUpdate, mechanism: Mechanism) -> list[str]:
    """The lines that the terminal shows: verdict, names, errors held out, what is open, what to measure next."""
    lines = [f"verdict: {found.verdict}", found.reason]
    named = list(zip(found.parameters, found.x, found.errors, found.named, found.told, strict=True))
    lines += [f"wrong in the file: {told(one, x, error)}" for one, x, error, name, _ in named if name]
    others = [told(one, x, error) for one, x, error, name, known in named if known and not name]
    if found.verdict != "unexplained":
        lines += [f"updated, not named: {text}" for text in others]
    for one in found.held_out:
        lines.append(
            f"error on {one.name}, left out: {one.before:.3g} times the noise as filed, {one.after:.3g} updated"
        )
    if found.modes_off:
        lines.append(f"modes are still off by {100 * found.modes_off:.2g} % in frequency, beyond the noise")
    lines += [direction.sentence for direction in found.open]
    if found.next is not None:
        lines.append(_next(found, mechanism))
    return lines


def told(one: UpdateParameter, x: float, error: float) -> str:
    """A number with its error, in a user's units; a logarithm as a factor."""
    if one.logarithmic:
        return f"{one.name}: times {with_error(math.exp(x), math.exp(x) * error)}"
    unit, factor = UNITS.get(one.unit, (one.unit, 1.0))
    return f"{one.name}: {with_error(factor * x, factor * error, sign=True)} {unit}".rstrip()


def _next(found: RobotUpdate, mechanism: Mechanism) -> str:
    assert found.next is not None
    where = found.next.name or shown_values(mechanism, found.next.driven)
    what = ", ".join(f"{name} to {100 * left:.0f} %" for name, left in found.next.sharpens)
    gains = f"; errors fall: {what}" if what else ""
    return f"measure next: {where} ({found.next.gain:.2g} nats{gains}); check first that the robot may stand there"


def as_json(found: RobotUpdate) -> dict[str, Any]:
    """All of an update: ``format``, verdict, numbers, covariance, errors held out, open directions, next posture."""
    numbers = [
        {
            "name": one.name,
            "kind": one.kind,
            "unit": one.unit,
            "logarithm_of_factor": one.logarithmic,
            "value": float(x),
            "standard_error": float(error),
            "told": bool(known),
            "named": bool(name),
        }
        for one, x, error, known, name in zip(
            found.parameters, found.x, found.errors, found.told, found.named, strict=True
        )
    ]
    following = found.next
    return {
        "format": FORMAT,
        "format_version": 1,
        "verdict": found.verdict,
        "reason": found.reason,
        "numbers": numbers,
        "covariance": np.asarray(found.covariance).tolist(),
        "held_out": [{"name": one.name, "before": one.before, "after": one.after} for one in found.held_out],
        "fitted": found.fitted.tolist(),
        "noise": found.noise,
        "modes_off": found.modes_off,
        "open": [{"names": one.names, "parts": one.parts, "left": one.left} for one in found.open],
        "next": None
        if following is None
        else {"name": following.name, "driven": following.driven.tolist(), "gain_nats": following.gain},
    }


def _check_readable(unfinished: Path, out: Path, lines: Sequence[str]) -> None:
    """Read the file before it takes its name: numbers may fit what was measured and still be no robot."""
    named = unfinished.with_suffix(".toml")  # a robot file is known by its suffix
    unfinished.rename(named)
    try:
        read_robot(named)
    except MillfrfError as error:
        why = str(error).replace(f"{named}: ", "")
        said = f"{out} was not written, for no robot has these numbers: {why}; are posture, axes and band right?"
        say("\n".join(lines))  # an error is one line: what was found goes before it
        raise MillfrfError(said) from error
    finally:
        named.rename(unfinished)


def update_robot_file(robot: str, paths: Sequence[Path], out: Path, report: Path | None, asking: Asking) -> list[str]:
    """Update a robot's file by measurements; lines that sum it up.

    Raises
    ------
    InputError
        Files that cannot be used together.
    MillfrfError
        Nothing explains what was measured, so that no robot file is written; the report is.
    """
    check_output(out, (".toml",), paths)
    if out.exists() and Path(robot).exists() and out.samefile(robot):
        raise InputError(f"--out {out} is the robot's own file; give another name, and compare the two")
    if report is not None:
        check_output(report, (".json",), paths)
    case = spatial(read_robot(robot))
    measured = read_measured(case, paths, asking)
    with bar("updating"):
        found = update_robot(case.robot, measured, case.poses)
    tell(lambda: {"update": as_json(found)})
    lines = summary(found, case.robot.mechanism)
    made = origin("robot update", [robot, *paths], asdict(asking))
    if report is not None:
        with writing_whole_file(report) as temporary:
            temporary.write_text(json.dumps(as_json(found), indent=1), encoding="utf-8")
        add_to_json(report, made)
        lines.append(f"wrote {report}")
    if found.verdict == "unexplained":
        say("\n".join(lines))
        raise MillfrfError(f"{out} was not written: no update of these numbers holds elsewhere")
    with writing_whole_file(out) as temporary:
        temporary.write_text(updated_document(numbered_robot_text(robot), case.robot, found), encoding="utf-8")
        add_comment(temporary, made)
        _check_readable(temporary, out, lines)
    return [*lines, f"wrote {out}: the robot's file with {len(found.parameters)} numbers updated and their covariance"]
