"""Step ``predict``: responses of a model to recorded forces."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from acquisition import RecordingFile, RecordingWriter, StreamDescription, opened, path_of
from millfrf.core import Real, Result, Summary, doubts_line, listed, writing_whole_file
from millfrf.core.provenance import made, with_warnings
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.gate import (
    check_drifts,
    check_model_and_recordings,
    check_prediction,
    check_preloads,
    check_scales,
)
from millfrf.mismatch import Prediction, read_recording, require_room_for_comparison
from millfrf.mismatch import predict as predict_responses

from .given import ModelGiven, files_among, model_of


@step
def predict(
    model: ModelGiven,
    recording: Annotated[RecordingFile, Reads("REC.h5")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".h5",), needed=True)] = None,
    stream: str | None = None,
) -> "Predicted":
    """Simulate the response of a model to recorded forces, and compare it with the measured responses.

    Parameters
    ----------
    model
        Modal model, with or without the terms of a diagnosis.
    recording
        Recording whose forces are used.
    out
        Recording of the predicted responses to write.
    stream
        Sample clock; needed where a recording has several.

    Returns
    -------
    Predicted
        Predicted and measured responses, their errors and the warnings.

    Raises
    ------
    InputError
        A model and a recording that cannot be compared.

    Examples
    --------
    ::

        $ millfrf predict tip.json rec1.h5 --out predicted.h5
    """
    modal_model, _, _ = model_of(model)
    model_name = model if isinstance(model, str | os.PathLike) else "the model"
    with opened(recording) as source:
        require_room_for_comparison([source], modal_model, stream=stream)
        warnings = check_model_and_recordings(model_name, modal_model, [source], stream)
        recorded = read_recording(source, modal_model, stream=stream)
        prediction = predict_responses(modal_model, recorded)
        clock = source.stream(stream)
        start_time, clock_name, setup = clock.start_time, clock.name, source.setup
    names = tuple(channel.name for channel in recorded.responses)
    after_run_in = slice(prediction.run_in, None)
    warnings += check_preloads(modal_model, recorded.name) + check_drifts(modal_model, recorded)
    warnings += check_scales(names, recorded.response[after_run_in], prediction.response[after_run_in])
    rest = recorded.part(recorded.name, prediction.run_in, len(recorded.force))
    warnings += check_prediction(rest, prediction.response[after_run_in], prediction.band)
    description = StreamDescription(clock_name, recorded.rate, start_time + recorded.start, recorded.responses)
    result = Predicted(prediction, recorded.response, description, setup, tuple(warnings))
    if out is not None:
        write_prediction(out, result, files_among(model, path_of(recording)))
    warn(result.warnings)
    tell(lambda: _errors(result))
    for line in prediction_lines(result):
        say(line)
    say_written([out])
    return result


@dataclass(frozen=True, eq=False, repr=False)
class Predicted(Result):
    """Responses of a model to the forces of a recording, and the measured responses.

    Parameters
    ----------
    prediction
        Predicted responses in the measured quantities, with their errors and the band.
    measured : (n_samples, n_responses)
        Measured responses, SI units of each channel.
    description
        Clock of the recording: its name, sample rate (Hz), start (s) and the channels of the responses.
    setup
        Set-up of the recording as TOML text.
    warnings
        Warnings about the prediction, one sentence each.
    """

    prediction: Prediction
    measured: Real
    description: StreamDescription
    setup: str
    warnings: tuple[str, ...] = ()

    @property
    def run_in(self) -> float:
        """Time in which the free decay from the unknown initial motion is not negligible, s."""
        return self.prediction.run_in / self.description.sample_rate

    def _summary(self) -> Summary:
        prediction, (low, high) = self.prediction, self.prediction.band
        names = [channel.name for channel in self.description.channels]
        errors = [f"{100 * float(error):.3g} %" for error in prediction.error]
        return Summary(
            f"Predicted: {len(prediction.response)} samples of {listed(names)}",
            (
                f"error {100 * prediction.total_error:.3g} % in {low:.3g} to {high:.3g} Hz after {self.run_in:.3g} s",
                f"by response {listed([f'{name} {error}' for name, error in zip(names, errors, strict=True)])}",
                *doubts_line(self.warnings),
            ),
            ("response", "error of the measured root mean square"),
            tuple(zip(names, errors, strict=True)),
        )


def write_prediction(
    out: str | os.PathLike[str],
    predicted: Predicted,
    inputs: Sequence[Path],
) -> None:
    """Write predicted responses as a recording with the warnings in its set-up; ``inputs`` give the title."""
    by = f" by {inputs[0].name}" if len(inputs) > 1 else ""
    title = f"responses predicted for {inputs[-1].name}{by}"
    setup = with_warnings(predicted.setup, predicted.warnings)
    origin = made("predict", inputs)
    with (
        writing_whole_file(out) as temporary,
        RecordingWriter(
            temporary, (predicted.description,), title=title, setup=setup, provenance=origin, spare_bytes=1_000_000
        ) as writer,
    ):
        writer.append(predicted.description.name, predicted.prediction.response)


def prediction_lines(predicted: Predicted) -> list[str]:
    """Errors of each response and of all, as lines for the terminal."""
    prediction, (low, high) = predicted.prediction, predicted.prediction.band
    lines = [
        f"{channel.name}: error {100 * float(error):.3g} % of the measured root mean square"
        for channel, error in zip(predicted.description.channels, prediction.error, strict=True)
    ]
    return [
        *lines,
        f"all responses: {100 * prediction.total_error:.3g} % ({low:.3g} to {high:.3g} Hz, after "
        f"{predicted.run_in:.3g} s of run-in)",
    ]


def _errors(predicted: Predicted) -> dict[str, object]:
    """Return the errors of the responses for JSON."""
    prediction = predicted.prediction
    names = [channel.name for channel in predicted.description.channels]
    return {
        "error_share": prediction.total_error,
        "error_shares": dict(zip(names, prediction.error, strict=True)),
        "band_hz": prediction.band,
        "run_in_s": predicted.run_in,
    }
