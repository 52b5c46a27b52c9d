"""`diagnose`: what a model leaves out of recordings."""

import os

from millfrf.core import Band, InputError
from millfrf.core.progress import Progress, silent
from millfrf.mismatch import Settings, StructureDiagnosis

from .diagnose import diagnose_recordings
from .given import GivenModel, GivenRecording, files_of, model_of, warn_of


def diagnose(
    model: GivenModel,
    *recordings: GivenRecording,
    settings: Settings | None = None,
    stream: str | None = None,
    band: Band | None = None,
    progress: Progress = silent,
) -> StructureDiagnosis:
    """Locate where a model and recordings disagree, name the physics left out, and prove it on held-out data.

    Parameters
    ----------
    model
        Nominal modal model, what ``fit`` returned, or the name of a file.
    recordings
        Recordings or the names of their files, best at several levels.
    settings
        Thresholds of the decisions; None: the defaults.
    stream
        Name of the sample clock; None: the only one.
    band
        Lowest and highest frequency that are compared, Hz; None: the band in which the model holds.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    Diagnosis
        Verdict, causes with their evidence, errors on held-out data, and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        No recording, or a model and recordings that cannot be compared.
    """
    if not recordings:
        raise InputError("no recording given; name the nominal model and then one or more recordings")
    known, _, _ = model_of(model)
    named = model if isinstance(model, str | os.PathLike) else "the model"
    files = files_of(recordings)
    found = diagnose_recordings(known, files, settings, model_file=named, stream=stream, band=band, progress=progress)
    warn_of(found.doubts)
    return found
