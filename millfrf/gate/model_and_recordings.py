"""A model beside recordings: what diagnose and predict ask before they compare them."""

import os
from collections.abc import Sequence
from pathlib import Path

from acquisition import Stream
from estimation import family_of, names_at, quantities_of_unit, refuse_shared
from modal_fit import ModalModel

from ..progress import Progress, silent
from .models import check_model, stored_doubts
from .recordings import RECORD_AGAIN, check_channels


def check_model_and_recordings(
    model_path: str | os.PathLike[str],
    model: ModalModel,
    recordings: Sequence[str | os.PathLike[str]],
    stream: str | None = None,
    progress: Progress = silent,
) -> list[str]:
    """Judge a model, what its file says of its fit, and the channels of recordings at its degrees of freedom.

    Parameters
    ----------
    model_path
        File of the model.
    model
        What was read of it.
    recordings
        Files it is compared with.
    stream
        Sample clock; None: the only one.
    progress
        Shows progress while samples are read.

    Returns
    -------
    list of str
        Doubts on the model, on the fit that it comes from and on each recording.

    Raises
    ------
    InputError
        As :func:`millfrf.gate.check_model` and :func:`millfrf.gate.check_recordings`.
    """
    doubts = [*check_model(model, Path(model_path).name), *stored_doubts(model_path)]
    if not recordings:
        return doubts

    response, excites = quantities_of_unit(model.unit)
    motions = family_of(response)

    def chosen(source: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
        # those that are missing are the reader's to refuse
        channels = source.channels
        exciting = names_at(channels, model.excitations, (excites,))
        responding = names_at(channels, model.responses, motions)
        refuse_shared(exciting, responding, source.path.name)
        return exciting, responding

    return [*doubts, *check_channels(recordings, chosen, stream, progress=progress, remedy=RECORD_AGAIN)]
