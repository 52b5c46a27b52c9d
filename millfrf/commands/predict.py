"""`millfrf predict`: the responses a model gives for recorded forces."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Output, check_output, echo_warnings

if TYPE_CHECKING:
    from millfrf.steps.predict import Predicted


def predict(
    model: Annotated[Path, typer.Argument(metavar="MODEL.json", help="Model, with or without terms of physics.")],
    recording: Annotated[Path, typer.Argument(metavar="REC.h5", help="Recording whose forces are used.")],
    out: Output,
    stream: Annotated[str | None, typer.Option("--stream", help="Sample clock.")] = None,
) -> None:
    """Simulate a recording's forces through a model; print how far measured responses are off."""
    from millfrf.steps.face_predict import predict as predict_responses
    from millfrf.steps.predict import prediction_lines, write_prediction

    check_output(out, (".h5",), [recording])
    found = predict_responses(model, recording, stream=stream)
    write_prediction(out, found, model, recording)
    echo_warnings(found.warnings)
    tell(lambda: _errors(found))
    for line in prediction_lines(found):
        say(line)
    say(f"wrote {out}")


def _errors(found: "Predicted") -> dict[str, object]:
    """How far each response is off, for a script."""
    predicted = found.prediction
    names = [channel.name for channel in found.description.channels]
    return {
        "error_share": predicted.total_error,
        "error_shares": dict(zip(names, predicted.error, strict=True)),
        "band_hz": predicted.band,
        "run_in_s": found.run_in,
    }
