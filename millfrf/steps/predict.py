"""Step ``predict``: responses that a model gives for recorded forces."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording, RecordingWriter, StreamDescription
from millfrf.core import Result, Summary, doubts_line, listed, writing_whole_file
from millfrf.core.provenance import made, with_warnings
from millfrf.gate import check_model_and_recordings, check_scales
from millfrf.mismatch import Prediction, predict, read_recording, require_room_for_comparison
from modal_fit import ModalModel


@dataclass(frozen=True, eq=False, repr=False)
class Predicted(Result):
    """Responses that a model gives for the forces of a recording, beside those that were measured.

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
        What a user should know before trusting the prediction; one sentence each.
    """

    prediction: Prediction
    measured: NDArray[np.float64]
    description: StreamDescription
    setup: str
    warnings: tuple[str, ...] = ()

    @property
    def run_in(self) -> float:
        """Time at the beginning in which the structure's unknown first motion still rings, s."""
        return self.prediction.run_in / self.description.sample_rate

    def _summary(self) -> Summary:
        found, (low, high) = self.prediction, self.prediction.band
        names = [channel.name for channel in self.description.channels]
        errors = [f"{100 * float(error):.3g} %" for error in found.error]
        return Summary(
            f"Predicted: {len(found.response)} samples of {listed(names)}",
            (
                f"error {100 * found.total_error:.3g} % in {low:.3g} to {high:.3g} Hz after {self.run_in:.3g} s",
                f"by response {listed([f'{name} {error}' for name, error in zip(names, errors, strict=True)])}",
                *doubts_line(self.warnings),
            ),
            ("response", "error of the measured root mean square"),
            tuple(zip(names, errors, strict=True)),
        )


def predict_recording(
    model: ModalModel,
    recording_path: str | os.PathLike[str],
    *,
    stream: str | None = None,
    model_file: str | os.PathLike[str] = "the model",
) -> Predicted:
    """Simulate the forces of a recording through a model.

    Parameters
    ----------
    model
        Modal model with or without terms of physics.
    recording_path
        Recording whose forces are used.
    stream
        Name of the sample clock; None: the only one.
    model_file
        File of the model, whose stored doubts count, and its name in messages.

    Raises
    ------
    InputError
        A model and a recording that cannot be compared.
    """
    require_room_for_comparison([recording_path], model, stream=stream)
    doubts = check_model_and_recordings(model_file, model, [recording_path], stream)
    recorded = read_recording(recording_path, model, stream=stream)
    result = predict(model, recorded)
    with Recording(recording_path) as recording:
        source = recording.stream(stream)
        start_time, clock, setup = source.start_time, source.name, recording.setup
    names = tuple(channel.name for channel in recorded.responses)
    kept = slice(result.run_in, None)
    doubts += check_scales(names, recorded.response[kept], result.response[kept])
    description = StreamDescription(clock, recorded.rate, start_time + recorded.start, recorded.responses)
    return Predicted(result, recorded.response, description, setup, tuple(doubts))


def write_prediction(
    out: str | os.PathLike[str],
    predicted: Predicted,
    model_path: str | os.PathLike[str],
    recording_path: str | os.PathLike[str],
) -> None:
    """Write predicted responses as a recording, with the doubts in its set-up.

    Parameters
    ----------
    out
        Recording to write.
    predicted
        Responses that a model gave.
    model_path, recording_path
        Files that it was made from, for the title.
    """
    title = f"responses predicted for {Path(recording_path).name} by {Path(model_path).name}"
    setup = with_warnings(predicted.setup, predicted.warnings)
    origin = made("predict", [model_path, recording_path])
    with (
        writing_whole_file(out) as temporary,
        RecordingWriter(
            temporary, (predicted.description,), title=title, setup=setup, provenance=origin, spare_bytes=1_000_000
        ) as writer,
    ):
        writer.append(predicted.description.name, predicted.prediction.response)


def prediction_lines(predicted: Predicted) -> list[str]:
    """Lines for the terminal that say how far each response is off."""
    found, (low, high) = predicted.prediction, predicted.prediction.band
    lines = [
        f"{channel.name}: error {100 * float(error):.3g} % of the measured root mean square"
        for channel, error in zip(predicted.description.channels, found.error, strict=True)
    ]
    return [
        *lines,
        f"all responses: {100 * found.total_error:.3g} % ({low:.3g} to {high:.3g} Hz, after "
        f"{predicted.run_in:.3g} s of run-in)",
    ]
