"""Step ``calibrate``: convert a modal model at the sensor to the tool tip."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from millfrf.core import writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import add_to_json, read_provenance, sources, versions
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import say, say_written, show, tell, warn
from millfrf.gate import (
    check_model,
    check_tip_and_sensor,
    check_tip_mass,
    check_tip_phase,
    effective_masses,
    stored_warnings,
    terms_left_out,
)
from millfrf.reports.tables import agreement_table, mode_table, source_table
from modal_fit import TipCalibration, calibrate_to_tip, write_modal_model

from .answers import model_answer
from .given import FrfGiven, ModelGiven, files_among, frf_of, model_of


@step
def calibrate(
    model: ModelGiven,
    /,
    tip: Annotated[FrfGiven, Reads("TT.h5")],
    sensor: Annotated[FrfGiven, Reads("ST.h5")],
    *,
    tip_above: Annotated[float | None, Typed("HZ")] = None,
    out: Annotated[File | None, Writes(suffixes=(".json",), needed=True)] = None,
) -> TipCalibration:
    """Convert an in-process model from the sensor to the tool tip with the ratio of each mode's shapes in hammer FRFs.

    Each mode shape is multiplied by ``phi_tip / phi_sensor`` of its mode in the two FRFs. Modes that
    only the taps show are added.

    Parameters
    ----------
    model
        In-process modal model at the sensor.
    tip
        FRF of hammer taps at the tip, with the response at the tip.
    sensor
        FRF of the same taps, with the response at the sensor.
    tip_above
        Frequency above which modes come from the taps; by default the upper end of the model's band.
    out
        Model file to write.

    Returns
    -------
    TipCalibration
        The model at the tip, the ratios and the warnings.

    Raises
    ------
    InputError
        Directions, points or modes that do not match, cut and taps that disagree in shape, scale or sign, or inputs
        that ``millfrf.gate`` refuses.

    Examples
    --------
    ::

        $ millfrf calibrate housing.json --tip tt.h5 --sensor st.h5 --out tip.json
    """
    at_sensor_model, _, _ = model_of(model)
    (at_tip, tip_name, _), (at_sensor, sensor_name, _) = frf_of(tip), frf_of(sensor)
    names = (tip_name, sensor_name) if tip_name != sensor_name else ("the tip's FRF", "the sensor's FRF")
    warnings = [
        *check_model(at_sensor_model),
        *terms_left_out(at_sensor_model),
        *check_tip_and_sensor(at_sensor_model, at_tip, at_sensor, names),
    ]
    with progress("calibrating to the tool tip"):
        result = calibrate_to_tip(at_sensor_model, at_tip, at_sensor, tip_above=tip_above)
    of_both = [*check_tip_phase(result), *check_tip_mass(result.model)]
    result = replace(result, warnings=(*of_both, *warnings, *result.warnings))
    if out is not None:
        write_calibration(out, result, files_among(model, tip, sensor))
    warn(result.warnings)
    tell(lambda: model_answer(result.model))
    for table in (
        mode_table(result.model),
        source_table(result.model),
        agreement_table({"cut_and_taps": _compared(result)}),
    ):
        if table is not None:
            show(table)
    say_written([out])
    if masses := effective_masses(result.model):
        listed = ", ".join(f"{mass:.3g} kg at {name}" for name, mass in masses.items())
        say(f"the modes move the tip like {listed}; a wrong sensitivity that cut and taps share shows here alone")
    return result


def _compared(calibration: TipCalibration) -> list[dict[str, float]]:
    """Return what cut and taps show of each in-process mode at the sensor."""
    agreement = calibration.agreement
    names = ("cut_hz", "tapped_hz", "assurance", "factor", "factor_phase_deg", "factor_error")
    factors, angles = np.abs(agreement.factors), np.degrees(np.angle(agreement.factors)) + 0.0  # no negative zero
    columns = (*agreement.frequencies.T, agreement.assurance, factors, angles, agreement.factor_errors)
    return [dict(zip(names, map(float, row), strict=True)) for row in zip(*columns, strict=True)]


def write_calibration(path: File, calibration: TipCalibration, inputs: Sequence[File]) -> None:
    """Write the model at the tip with the ratios, and the provenance of the model at the sensor (the first input)."""
    before = read_provenance(inputs[0]) if inputs else {}
    of_taps = [text for path in inputs[1:] for text in stored_warnings(path)]
    provenance: dict[str, Any] = {
        **{key: before[key] for key in ("band_hz", "method", "cuts") if key in before},
        "step": "calibrate",
        "sources": sources(inputs),
        "ratios": np.stack([calibration.ratios.real, calibration.ratios.imag], axis=-1).tolist(),
        "cut_and_taps": _compared(calibration),
        "warnings": list(dict.fromkeys([*before.get("warnings", []), *of_taps, *calibration.warnings])),
        "versions": versions(),
    }
    with writing_whole_file(path) as temporary:
        write_modal_model(temporary, calibration.model)
        add_to_json(temporary, provenance)
