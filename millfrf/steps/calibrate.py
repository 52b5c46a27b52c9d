"""Step ``calibrate``: a model at the sensor becomes one at the tool tip."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from estimation import Frf
from millfrf.core import writing_whole_file
from millfrf.core.progress import Progress, silent
from millfrf.core.provenance import add_to_json, read_provenance, sources, versions
from millfrf.gate import check_model, check_tip_and_sensor, stored_doubts, terms_left_out
from modal_fit import ModalModel, TipCalibration, calibrate_to_tip, write_modal_model


def calibrate_model(
    model: ModalModel,
    tip: Frf,
    sensor: Frf,
    progress: Progress = silent,
    names: tuple[str, str] = ("the tip's FRF", "the sensor's FRF"),
) -> TipCalibration:
    """Carry a model to the tool tip by two hammer FRFs.

    Raises
    ------
    InputError
        Directions, points or modes that do not match, or inputs that :mod:`millfrf.gate` refuses; ``names`` are those
        of the FRFs in its messages.
    """
    doubts = [*check_model(model), *terms_left_out(model), *check_tip_and_sensor(model, tip, sensor, names)]
    with progress("calibrating to the tool tip"):
        found = calibrate_to_tip(model, tip, sensor)
    return replace(found, warnings=(*doubts, *found.warnings))


def write_calibration(
    path: str | os.PathLike[str], calibration: TipCalibration, inputs: Sequence[str | os.PathLike[str]]
) -> None:
    """Write the tip's model with the ratios and with the provenance of the model it came from (the first input)."""
    before = read_provenance(inputs[0])
    of_taps = [text for path in inputs[1:] for text in stored_doubts(path)]
    provenance: dict[str, Any] = {
        **{key: before[key] for key in ("band_hz", "method") if key in before},
        "step": "calibrate",
        "sources": sources(inputs),
        "ratios": np.stack([calibration.ratios.real, calibration.ratios.imag], axis=-1).tolist(),
        "warnings": list(dict.fromkeys([*before.get("warnings", []), *of_taps, *calibration.warnings])),
        "versions": versions(),
    }
    with writing_whole_file(path) as temporary:
        write_modal_model(temporary, calibration.model)
        add_to_json(temporary, provenance)
