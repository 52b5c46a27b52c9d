"""The step from a model and a recording to a recording of predicted responses."""

import os
from pathlib import Path

from acquisition import Recording, RecordingWriter, StreamDescription
from mismatch import read_recording
from mismatch.models.prediction import predict
from modal_fit import read_modal_model

from ..gate import check_model_and_recordings, check_scales
from ..provenance import with_warnings


def predict_file(
    model_path: str | os.PathLike[str],
    recording_path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    stream: str | None = None,
) -> list[str]:
    """Write predicted responses beside the forces; return lines that say how far they are off.

    Raises
    ------
    InputError
        Files that cannot be used together.
    """
    model = read_modal_model(model_path)
    doubts = check_model_and_recordings(model_path, model, [recording_path], stream)
    recorded = read_recording(recording_path, model, stream=stream)
    result = predict(model, recorded)
    with Recording(recording_path) as recording:
        source = recording.stream(stream)
        start_time, name, setup = source.start_time, source.name, recording.setup
    names = tuple(channel.name for channel in recorded.responses)
    description = StreamDescription(name, recorded.rate, start_time + recorded.start, recorded.responses)
    title = f"responses predicted for {Path(recording_path).name} by {Path(model_path).name}"
    kept = slice(result.run_in, None)
    doubts += check_scales(names, recorded.response[kept], result.response[kept])
    setup = with_warnings(setup, doubts)
    with RecordingWriter(out, (description,), title=title, setup=setup) as writer:
        writer.append(name, result.response)
    lines = [f"warning: {doubt}" for doubt in doubts]
    lines += [
        f"{one}: error {100 * float(error):.3g} % of the measured root mean square"
        for one, error in zip(names, result.error, strict=True)
    ]
    low, high = result.band
    return [
        *lines,
        f"all responses: {100 * result.total_error:.3g} % ({low:.3g} to {high:.3g} Hz, after "
        f"{result.run_in / recorded.rate:.3g} s of run-in)",
        f"wrote {out}",
    ]
