"""`millfrf calibrate`: a model at the sensor becomes one at the tool tip."""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Output, check_output, echo_warnings


def calibrate(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="In-process model at the sensor.")],
    tip: Annotated[Path, typer.Option("--tip", metavar="TT.h5", help="Hammer FRF: tapped at the tip, motion there.")],
    sensor: Annotated[Path, typer.Option("--sensor", metavar="ST.h5", help="Hammer FRF: motion at the sensor.")],
    out: Output,
) -> None:
    """Carry an in-process model from the sensor to the tool tip by two hammer FRFs."""
    from millfrf.core.progress import bar
    from millfrf.core.terminal import show
    from millfrf.report.tables import mode_table
    from millfrf.steps.answers import model_answer
    from millfrf.steps.calibrate import write_calibration
    from millfrf.steps.face_fit import calibrate as calibrate_to_tip

    check_output(out, (".json",), [model, tip, sensor])
    result = calibrate_to_tip(model, tip, sensor, progress=bar)
    write_calibration(out, result, [model, tip, sensor])
    echo_warnings(result.warnings)
    tell(lambda: model_answer(result.model))
    show(mode_table(result.model))
    say(f"wrote {out}")
