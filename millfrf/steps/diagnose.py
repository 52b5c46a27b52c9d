"""Step ``diagnose``: what a modal model leaves out of recordings."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from millfrf.core import Band, writing_whole_folder
from millfrf.core.progress import Progress, silent
from millfrf.core.provenance import add_to_json, origin
from millfrf.cutting import MillingProcess
from millfrf.gate import check_model_and_recordings
from millfrf.mismatch import (
    AcceptedCause,
    Settings,
    SpindleSpeed,
    StructureDiagnosis,
    diagnose,
    improved_model_of,
    joint_in_words,
    measured_part,
    read_recordings,
    require_room_for_comparison,
    spindle_speed,
    tip_axes,
    write_diagnosis,
)
from millfrf.report.diagnoses.answers import left_in_words
from millfrf.report.diagnoses.structure_page import write_diagnosis_report
from millfrf.report.results_page import FigureFiles
from millfrf.report.tables import evidence_in_words
from modal_fit import ModalModel, read_modal_model, write_modal_model

from .fit import SUBSPACE, FitOptions, fit_recordings
from .result_folder import refuse_file


def diagnosis_lines(diagnosis: StructureDiagnosis) -> list[str]:
    """A few lines for the terminal: verdict, causes with numbers, error before and after.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure.
    """
    lines = [f"verdict: {diagnosis.verdict}"]
    lines.append(diagnosis.details.band.sentence)
    lines += [f"warning: {doubt}" for doubt in diagnosis.doubts]
    lines += [_cause_line(diagnosis, cause) for cause in diagnosis.physics]
    if diagnosis.equivalents:
        lines.append(f"cannot be told from: {', '.join(diagnosis.equivalents)}")
    if diagnosis.verdict == "partly explained":
        lines.append(left_in_words(diagnosis))
    lines += [
        f"{one.name} is not told: {one.location['impossible']}"
        for one in diagnosis.candidates
        if one.stage == "impossible"
    ][:1]
    lines += list(diagnosis.content.get("not_asked_for", ()))
    if diagnosis.verdict == "unexplained":
        lines.append(
            f"{100 * diagnosis.leftover:.0f} % of what is left still moves with the signal: a cause is missing"
        )
    if diagnosis.details.behaviour is not None:
        lines.append(f"behaviour by level: {diagnosis.details.behaviour.sentence}")
    lines += free_form_in_words(diagnosis)
    lines.append(_error_line(diagnosis))
    offered = diagnosis.content.get("improved_model", {}).get("sentence")
    lines += [offered] if offered else []
    lines += [one["sentence"] for one in diagnosis.content.get("noise", ())]
    return lines


def free_form_in_words(diagnosis: StructureDiagnosis) -> tuple[str, ...]:
    """What a joint's force is where its form is free; empty where the recordings ask for no free form.

    Parameters
    ----------
    diagnosis
        The diagnosis of a structure.
    """
    found = diagnosis.content.get("free_form")
    return (found["sentence"],) if found else ()


def _cause_line(diagnosis: StructureDiagnosis, cause: AcceptedCause) -> str:
    """A cause with its place, its numbers with their standard errors, and its evidence."""
    numbers = ", ".join(
        f"{name} {value:.4g}" + (f" ± {cause.standard_errors[name]:.2g}" if name in cause.standard_errors else "")
        for name, value in cause.parameters.items()
    )
    axes = tip_axes(diagnosis.details.final.hypothesis.model)[2] if "direction" in cause.location else ()
    place = joint_in_words(cause.location, axes) or ", ".join(f"{key} {value}" for key, value in cause.location.items())
    return f"{cause.name}{f' ({place})' if place else ''}: {numbers}; {evidence_in_words(cause.evidence)}"


def _error_line(diagnosis: StructureDiagnosis) -> str:
    """Errors on the recording held out."""
    gain = diagnosis.improvement
    said = (
        f"{100 * gain.before:.3g} % nominal, {100 * gain.refitted:.3g} % refitted, {100 * gain.after:.3g} % improved, "
        f"noise {100 * gain.noise_floor:.3g} %"
    )
    if not diagnosis.details.tested:
        return f"error on {gain.held_out}, the only recording, so not held out: {said}"
    test = f", p = {gain.p_value:.2g} that improved is no better than {gain.against}" if diagnosis.physics else ""
    return f"error on {gain.where}, held out: {said}{test}"


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
