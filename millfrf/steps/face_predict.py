"""`predict`: the responses that a model gives for the forces of a recording."""

import os

from .given import GivenModel, GivenRecording, files_of, model_of, warn_of
from .predict import Predicted, predict_recording


def predict(model: GivenModel, recording: GivenRecording, *, stream: str | None = None) -> Predicted:
    """Simulate a recording's forces through a model and compare with the measured responses.

    Parameters
    ----------
    model
        Modal model with or without terms of physics, what ``fit`` returned, or the name of a file.
    recording
        Recording whose forces are used, or the name of its file.
    stream
        Name of the sample clock; None: the only one.

    Returns
    -------
    Predicted
        Predicted beside measured responses, their errors and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        A model and a recording that cannot be compared.
    """
    known, _, _ = model_of(model)
    [file] = files_of([recording])
    named = model if isinstance(model, str | os.PathLike) else "the model"
    found = predict_recording(known, file, stream=stream, model_file=named)
    warn_of(found.warnings)
    return found
