"""Step ``diagnose``: physics that a modal model neglects, from recordings."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Gt

from acquisition import Recording, all_opened, path_of
from millfrf.core import InputError, writing_whole_folder
from millfrf.core.progress import progress
from millfrf.core.provenance import add_to_json, origin
from millfrf.core.steps import Band, File, PythonOnly, Reads, Shares, Typed, Writes, step
from millfrf.core.terminal import manner, say, silently, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import check_model, check_model_and_recordings
from millfrf.mismatch import (
    AcceptedCause,
    LabError,
    SearchSettings,
    Settings,
    StructureDiagnosis,
    improved_model_of,
    joint_in_words,
    measured_part,
    read_recordings,
    require_room_for_comparison,
    spindle_speed,
    tip_axes,
    with_refused_model,
    write_diagnosis,
)
from millfrf.mismatch import diagnose as diagnose_structure
from millfrf.reports.diagnoses.answers import held_out_in_turn, left_in_words, missing_force_in_words
from millfrf.reports.diagnoses.structure_page import write_diagnosis_report
from millfrf.reports.results_page import FigureFiles
from millfrf.reports.tables import evidence_in_words
from modal_fit import ModalModel, write_modal_model

from .answers import stored_answer
from .fit import fit
from .given import CutGiven, FigureFormat, Figures, HasModel, RecordingGiven, files_among, model_of, process_of

FILES = ("diagnosis.json", "improved_model.json", "report.html")  # files that a diagnosis writes into its folder


@step
def diagnose(
    model: Annotated[File | ModalModel | HasModel | Recording, Reads("MODEL.json")],
    /,
    *recordings: RecordingGiven,
    out: Annotated[File | None, Writes("DIR", needed=True, files=FILES)] = None,
    simulated: Annotated[File | None, Reads("SIM.h5")] = None,
    band: Band | None = None,
    lab_error: Shares = (0.01, 0.12, 0.03),
    cutting: CutGiven | None = None,
    search_work: Annotated[float, Typed("MILLIONS"), Gt(0)] = SearchSettings().most_work,
    stream: str | None = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
    settings: Annotated[Settings | None, PythonOnly()] = None,
) -> StructureDiagnosis:
    """Locate where a model and recordings disagree, identify the neglected physics, and test the improved model.

    The folder that is written holds the diagnosis, the improved model and a report.

    Parameters
    ----------
    model
        Nominal modal model; with --simulated the first of the recordings.
    recordings
        Recordings to compare it with, best at several levels.
    out
        Folder for diagnosis, improved model and report.
    simulated
        Simulated recording to fit the nominal model from, in --band.
    band : Hz
        Band that is compared; without it the band of the model.
    lab_error
        Uncertainty of a laboratory's own fit, as shares: frequency, damping, shapes; one number applies to all.
    cutting
        Cut whose stability lobes the report shows.
    search_work
        Work after which no further cause is searched: millions of values that fits compute, about 30 in a second.
    stream
        Sample clock; needed where a recording has several.
    figures
        Folder for each figure of the report as a file.
    figure_format
        Format of these files.
    settings
        Thresholds of the decisions; without it those from lab_error and search_work.

    Returns
    -------
    StructureDiagnosis
        Verdict, causes with their evidence, errors on held-out data, and the warnings.

    Raises
    ------
    InputError
        No recording, a model and recordings that cannot be compared, or a folder that cannot be made.

    Examples
    --------
    ::

        $ millfrf diagnose idle.json low.h5 mid.h5 high.h5 --out diagnosis
    """
    check_shares("lab-error", lab_error)
    figure_files = None if figures is None else FigureFiles(Path(figures), figure_format)
    # with --simulated the nominal model comes from there, and the first argument is a recording too
    measured: tuple[Any, ...] = recordings if simulated is None else (model, *recordings)
    if not measured:
        raise InputError("no recording given; name the nominal model and then one or more recordings")
    source: Any = model if simulated is None else nominal_from_simulation(simulated, band, out, stream)
    process, doubts = (None, []) if cutting is None else process_of(cutting)
    warn(doubts)
    nominal, _, _ = model_of(source)
    model_name = source if isinstance(source, str | os.PathLike) else "the model"
    settings = settings or Settings(LabError(*lab_error), search=SearchSettings(most_work=search_work))
    with all_opened(measured) as opened_recordings:
        diagnosis = _diagnosed(nominal, opened_recordings, settings, model_name, stream, band)
        lines = _lines(nominal, opened_recordings, diagnosis, stream)
    if out is not None:
        options = {"stream": stream, "band_hz": band, "settings": settings}
        made_of = origin("diagnose", files_among(source, *map(path_of, measured)), options)
        write_diagnosis_folder(Path(out), diagnosis, Path(model_name).name, made_of, process, figures=figure_files)
        tell(lambda: {"diagnosis": stored_answer(Path(out) / FILES[0])})
    if manner().silent:
        warn(diagnosis.doubts)
    for line in lines:  # the warnings are among them
        say(line)
    if out is not None:
        say(f"wrote {', '.join(str(Path(out) / name) for name in FILES)}")
    return diagnosis


def _diagnosed(
    model: ModalModel,
    recordings: Sequence[Recording],
    settings: Settings,
    model_file: File,
    stream: str | None,
    band: Band | None,
) -> StructureDiagnosis:
    """Diagnose a nominal model with recordings; leave out responses of the model that no recording contains."""
    compared = measured_part(model, recordings, stream=stream)
    require_room_for_comparison(recordings, compared, stream=stream, band=band)
    doubts = check_model_and_recordings(model_file, compared, recordings, stream)
    trials = read_recordings(recordings, compared, stream=stream, band=band)
    stated = {recording.path.stem: spindle_speed(recording) for recording in recordings}
    speeds = {name: speed for name, speed in stated.items() if speed is not None}
    with diagnosing():
        diagnosis = diagnose_structure(compared, trials, settings, speeds=speeds, band=band)
    return checked_by_gate(replace(diagnosis, doubts=(*doubts, *diagnosis.doubts)))


def checked_by_gate(diagnosis: StructureDiagnosis) -> StructureDiagnosis:
    """Return the diagnosis; if `predict` and `lobes` would refuse its improved model, this model explains nothing."""
    try:
        check_model(improved_model_of(diagnosis), "the improved model")
    except InputError as refusal:
        return with_refused_model(diagnosis, str(refusal))
    return diagnosis


@contextmanager
def diagnosing() -> Iterator[None]:
    """Show the progress of a diagnosis; an interrupted diagnosis has no verdict."""
    with progress("diagnosing"):
        try:
            yield
        except KeyboardInterrupt:
            raise KeyboardInterrupt("not finished, no verdict: stopped; nothing was written") from None


def _lines(
    model: ModalModel, recordings: Sequence[Recording], diagnosis: StructureDiagnosis, stream: str | None
) -> list[str]:
    """Return the lines of the diagnosis, after a note on the responses that were left out."""
    measured = measured_part(model, recordings, stream=stream).responses
    missing = [label for label in model.responses if label not in measured]
    note = [f"no recording of {', '.join(missing)}: left out of the comparison and of the model"] if missing else []
    return [*note, *diagnosis_lines(diagnosis)]


def write_diagnosis_folder(
    folder: Path,
    diagnosis: StructureDiagnosis,
    model_name: str,
    made_of: Mapping[str, Any],
    process: MillingProcess | None = None,
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write diagnosis, improved model and report into a folder; ``process``: cut whose lobes the report shows.

    Without ``dated`` the report has no time, so that equal input gives equal bytes.
    """
    refuse_file(folder)
    with writing_whole_folder(folder) as unfinished:
        paths = [unfinished / name for name in FILES]
        write_diagnosis(paths[0], diagnosis)
        write_modal_model(paths[1], improved_model_of(diagnosis))
        for path in paths[:2]:
            add_to_json(path, made_of)
        with progress("writing the report"):
            write_diagnosis_report(paths[2], diagnosis, model_name, process, dated=dated, figures=figures)


def diagnosis_lines(diagnosis: StructureDiagnosis) -> list[str]:
    """Lines for the terminal: verdict, causes with numbers, error before and after."""
    content = diagnosis.content
    lines = [f"verdict: {diagnosis.verdict}", diagnosis.details.band.sentence]
    lines += [f"warning: {doubt}" for doubt in diagnosis.doubts]
    lines += [_cause_line(diagnosis, cause) for cause in diagnosis.physics]
    if diagnosis.equivalents:
        lines.append(f"cannot be distinguished from: {', '.join(diagnosis.equivalents)}")
    if diagnosis.verdict == "partly explained":
        lines.append(left_in_words(diagnosis))
    lines += [
        f"{candidate.name} is not determined: {candidate.location['impossible']}"
        for candidate in diagnosis.candidates
        if candidate.stage == "impossible"
    ][:1]
    lines += list(content.get("not_asked_for", ()))
    correlated = round(100 * diagnosis.leftover)
    if diagnosis.verdict == "unexplained" and correlated and not content.get("another_structure"):
        lines.append(f"{correlated} % of the residual is correlated with the signals: a cause is missing")
    if diagnosis.verdict == "unexplained":
        lines += missing_force_in_words(diagnosis)
    if diagnosis.details.behaviour is not None:
        lines.append(f"behaviour by level: {diagnosis.details.behaviour.sentence}")
    moving = content.get("modes_in_time")
    lines += [moving["sentence"]] if moving else []
    free_form = content.get("free_form")
    lines += [free_form["sentence"]] if free_form else []
    lines += [_error_line(diagnosis), *held_out_in_turn(diagnosis)]
    improved = content.get("improved_model", {}).get("sentence")
    lines += [improved] if improved else []
    lines += [noise["sentence"] for noise in content.get("noise", ())]
    return lines


def _cause_line(diagnosis: StructureDiagnosis, cause: AcceptedCause) -> str:
    """Describe a cause by its place, its numbers with standard errors, and its evidence."""
    numbers = ", ".join(
        f"{name} {value:.4g}" + (f" ± {cause.standard_errors[name]:.2g}" if name in cause.standard_errors else "")
        for name, value in cause.parameters.items()
    )
    axes = tip_axes(diagnosis.details.final.hypothesis.model)[2] if "direction" in cause.location else ()
    place = joint_in_words(cause.location, axes) or ", ".join(
        f"{key} {', '.join(value) if key in ('channels', 'moved') else value}" for key, value in cause.location.items()
    )
    stated = f"{numbers}; " if numbers else ""
    return f"{cause.name}{f' ({place})' if place else ''}: {stated}{evidence_in_words(cause.evidence)}"


def _error_line(diagnosis: StructureDiagnosis) -> str:
    """Describe the errors on the held-out recording."""
    gain = diagnosis.improvement
    errors = (
        f"{100 * gain.before:.3g} % nominal, {100 * gain.refitted:.3g} % refitted, {100 * gain.after:.3g} % improved, "
        f"noise {100 * gain.noise_floor:.3g} %"
    )
    if not diagnosis.details.tested:
        return f"error on {gain.held_out}, the only recording, so not held out: {errors}"
    test = f", p = {gain.p_value:.2g} that improved is no better than {gain.against}" if diagnosis.physics else ""
    return f"error on {gain.where}, held out: {errors}{test}"


def nominal_from_simulation(simulated: File, band: Band | None, out: File | None, stream: str | None = None) -> Path:
    """Fit the nominal model to a simulated recording by the subspace method, and write it as ``nominal.json``."""
    if band is None:
        raise InputError("--simulated needs --band LO HI, the band in which the nominal model is fitted and compared")
    if out is None:
        raise InputError("--simulated needs --out DIR, the folder to which the nominal model is written")
    with silently():
        fitted = fit(simulated, band=band, stream=stream)
    Path(out).mkdir(parents=True, exist_ok=True)
    path = Path(out) / "nominal.json"
    write_modal_model(path, fitted.model)
    return path


def refuse_file(folder: Path) -> None:
    """Refuse an existing file as the output folder, before the long computation."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder with --out")


def check_shares(option: str, shares: tuple[float, ...], example: tuple[float, ...] = (0.01, 0.12, 0.03)) -> None:
    """Refuse errors that are no shares, such as percent."""
    if not all(0 < share < 1 for share in shares):
        typed, right = (" ".join(f"{share:g}" for share in values) for values in (shares, example))
        raise InputError(
            f"--{option} {typed}: give {len(shares)} positive shares below 1 (0.12 is 12 %), for example {right}"
        )
