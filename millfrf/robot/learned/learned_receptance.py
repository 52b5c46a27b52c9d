"""`millfrf robot frf --learned`: receptance with a band in a posture that was not measured."""

import csv
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import write_frf
from millfrf.core import TIP, InputError, warning_lines, writing_whole_file
from millfrf.robot_model import PredictedPosture, predict_posture, read_learned_postures, read_robot, shown_values
from modal_fit import write_modal_model

from ...answers import model_answer
from ...options import check_band, check_output
from ...progress import bar
from ...provenance import add_comment, add_to_json, origin
from ...tables import Table, show
from ...terminal import say, tell
from ..asked_loads import check_positive
from ..postures import Asked, posture_of, spatial

Real = NDArray[np.float64]


def predicted_in(robot: str, learned: Path, asked: Asked) -> tuple[PredictedPosture, str]:
    """What a file of learned postures says of a posture, and the posture in words.

    Raises
    ------
    InputError
        A planar robot, another robot than that which was learned, or a posture out of reach.
    """
    case = spatial(read_robot(robot))
    known = read_learned_postures(learned, case.robot)
    driven, axes = posture_of(case, asked)
    with bar("predicting"):
        found = predict_posture(known, driven, axes=axes)
    return found, shown_values(case.robot.mechanism, driven)


def write_learned_receptance(
    robot: str, learned: Path, asked: Asked, out: Path, band: tuple[float, float], lines: int
) -> None:
    """Modal model with covariance (.json), receptance in the middle (.h5), or its band as a table (.csv)."""
    check_output(out, (".h5", ".json", ".csv"), [learned])
    check_band(band)
    check_positive("band", band[1], "Hz", 1e6)
    if not 2 <= lines <= 1_000_000:
        raise InputError(f"{lines} frequency lines: give 2 to 1000000")
    found, posture = predicted_in(robot, learned, asked)
    provenance = {
        "command": "robot frf",
        "robot": robot,
        "posture": posture,
        "warnings": list(found.warnings),
        **origin("robot frf", [robot, learned], {"learned": learned.name}),
    }
    axis = np.linspace(*band, lines)
    if out.suffix == ".json":
        with writing_whole_file(out) as temporary:
            write_modal_model(temporary, found.model)
            add_to_json(temporary, provenance)
    elif out.suffix == ".h5":
        write_frf(out, found.model.frf(axis), provenance=json.dumps(provenance))
    else:
        with writing_whole_file(out) as temporary:
            _write_band(temporary, axis, found)
            add_comment(temporary, provenance)
    tell(lambda: {"posture": posture, **model_answer(found.model)})
    show(_table(found, posture))
    for warning in found.warnings:
        say(f"warning: {warning}")
    told = {".json": "with covariance", ".h5": "the middle alone; .csv has its band", ".csv": "with its 95 % band"}
    say(f"wrote {out}: {len(found.model.poles)} modes, {told[out.suffix]}")


def _table(found: PredictedPosture, posture: str) -> Table:
    frequency, damping = found.frequency_band(), 100 * found.damping_band()
    rows = tuple(
        (str(r + 1), f"{f:.3f}", _span(frequency[:, r], 3), f"{100 * z:.2f}", _span(damping[:, r], 2))
        for r, (f, z) in enumerate(zip(found.model.natural_frequencies, found.model.damping_ratios, strict=True))
    )
    columns = ("mode", "frequency (Hz)", "95 % band", "damping ratio (%)", "95 % band")
    return Table(f"Modes predicted in the posture {posture}", columns, rows)


def _span(ends: Real, digits: int) -> str:
    return f"{ends[0]:.{digits}f} - {ends[1]:.{digits}f}"


def _write_band(path: Path, axis: Real, found: PredictedPosture) -> None:
    """A row for each line and entry: magnitude in the middle and the ends of its band, m/N."""
    middle, ends = np.abs(found.model.receptance(axis)), found.receptance_band(axis)
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.writelines(warning_lines(found.warnings))
        writer = csv.writer(stream)
        writer.writerow(["frequency_hz", "response", "excitation", "magnitude_m_per_n", "low_m_per_n", "high_m_per_n"])
        for k, frequency in enumerate(axis):
            for p, response in enumerate(TIP):
                for q, excitation in enumerate(TIP):
                    values = (middle[k, p, q], ends[0, k, p, q], ends[1, k, p, q])
                    writer.writerow([f"{frequency:.9g}", response, excitation, *(f"{value:.6g}" for value in values)])
