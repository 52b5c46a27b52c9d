"""The step from a nominal model and recordings to a folder with the diagnosis and the improved model."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from millfrf.core import Band, writing_whole_folder
from millfrf.cutting import MillingProcess
from millfrf.mismatch import (
    Settings,
    SpindleSpeed,
    StructureDiagnosis,
    diagnose,
    improved_model_of,
    measured_part,
    read_recordings,
    require_room_for_comparison,
    spindle_speed,
    write_diagnosis,
)
from modal_fit import ModalModel, read_modal_model, write_modal_model

from ..chain import SUBSPACE, FitOptions, fit_recordings
from ..gate import check_model_and_recordings
from ..progress import Progress, silent
from ..provenance import add_to_json, origin
from ..report import FigureFiles, write_diagnosis_report
from ..result_folder import refuse_file
from .diagnosis_words import diagnosis_lines


@dataclass(frozen=True)
class DiagnosisFiles:
    """Files that a diagnosis wrote, and lines that sum it up."""

    diagnosis: StructureDiagnosis
    written: tuple[Path, ...]
    summary: tuple[str, ...]


def diagnose_files(
    model_path: str | os.PathLike[str],
    recordings: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    settings: Settings | None = None,
    *,
    stream: str | None = None,
    band: Band | None = None,
    process: MillingProcess | None = None,
    dated: bool = True,
    figures: FigureFiles | None = None,
    progress: Progress = silent,
) -> DiagnosisFiles:
    """Diagnose and write diagnosis, improved model and report into a folder, made if need be.

    A report that is not ``dated`` does not tell when it was written, so that equal input gives equal bytes. With
    ``figures`` each of its figures becomes a file too.

    Raises
    ------
    InputError
        Files that cannot be used together, or a folder that cannot be made.
    """
    folder = Path(out)
    refuse_file(folder)
    whole = read_modal_model(model_path)
    diagnosis = diagnose_recordings(
        whole, recordings, settings, model_file=model_path, stream=stream, band=band, progress=progress
    )
    names = ("diagnosis.json", "improved_model.json", "report.html")
    with writing_whole_folder(folder) as unfinished:
        paths = [unfinished / name for name in names]
        write_diagnosis(paths[0], diagnosis)
        write_modal_model(paths[1], improved_model_of(diagnosis))
        asked = {"stream": stream, "band_hz": band, "settings": settings}
        for path in paths[:2]:
            add_to_json(path, origin("diagnose", [model_path, *recordings], asked))
        with progress("writing the report"):
            write_diagnosis_report(paths[2], diagnosis, Path(model_path).name, process, dated=dated, figures=figures)
    measured = measured_part(whole, recordings, stream=stream).responses
    missing = [label for label in whole.responses if label not in measured]
    note = [f"no recording of {', '.join(missing)}: left out of the comparison and of the model"] if missing else []
    return DiagnosisFiles(diagnosis, tuple(folder / name for name in names), (*note, *diagnosis_lines(diagnosis)))


def diagnose_recordings(
    model: ModalModel,
    recordings: Sequence[str | os.PathLike[str]],
    settings: Settings | None = None,
    *,
    model_file: str | os.PathLike[str] = "the model",
    stream: str | None = None,
    band: Band | None = None,
    progress: Progress = silent,
) -> StructureDiagnosis:
    """Judge a nominal model beside recordings, with the doubts of the gate; nothing is written.

    Parameters
    ----------
    model
        Nominal modal model; responses that no recording measures are left out.
    recordings
        Recordings to compare it with, best at several levels.
    settings
        Thresholds of the decisions; None: the defaults.
    model_file
        File of the model, whose stored doubts count, and its name in messages.
    stream
        Name of the sample clock; None: the only one.
    band
        Band that is compared, Hz; None: that of the model.
    progress
        Shows progress while recordings are read and causes are tried.

    Raises
    ------
    InputError
        A model and recordings that cannot be compared.
    """
    compared = measured_part(model, recordings, stream=stream)
    require_room_for_comparison(recordings, compared, stream=stream, band=band)
    doubts = check_model_and_recordings(model_file, compared, recordings, stream, progress)
    trials = read_recordings(recordings, compared, stream=stream, band=band)
    with progress("diagnosing"):
        found = diagnose(compared, trials, settings, speeds=_speeds(recordings), band=band)
    return replace(found, doubts=(*doubts, *found.doubts))


def nominal_from_simulation(
    simulated: str | os.PathLike[str],
    band: tuple[float, float],
    out: str | os.PathLike[str],
    *,
    stream: str | None = None,
    progress: Progress = silent,
) -> Path:
    """Fit the nominal model to a simulated recording, by the subspace method; write it as ``nominal.json``.

    Raises
    ------
    InputError
        A recording that cannot be fitted in that band.
    """
    fitted = fit_recordings([simulated], FitOptions(band, SUBSPACE, stream=stream), progress)
    Path(out).mkdir(parents=True, exist_ok=True)
    path = Path(out) / "nominal.json"
    write_modal_model(path, fitted.model)
    return path


def _speeds(recordings: Sequence[str | os.PathLike[str]]) -> dict[str, SpindleSpeed]:
    """Spindle speed by recording's name, where it is stated."""
    stated = {Path(path).stem: spindle_speed(path) for path in recordings}
    return {name: speed for name, speed in stated.items() if speed is not None}
