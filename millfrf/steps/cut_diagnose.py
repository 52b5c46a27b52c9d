"""Step ``cut diagnose``: physics that a computed cutting force neglects."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from annotated_types import Gt, Lt

from acquisition import opened
from millfrf.core import InputError, with_error, writing_whole_folder
from millfrf.core.progress import progress
from millfrf.core.provenance import add_comment, add_to_json, origin
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import say, tell, warn
from millfrf.cutting import MillingProcess
from millfrf.gate import RECORD_AGAIN, check_depth, check_one_speed, check_recordings, read_checked_cutting
from millfrf.mismatch import (
    COEFFICIENTS,
    AcceptedCause,
    CutDiagnosis,
    diagnose_cut,
    read_cut_recording,
    require_room_for_cut,
    write_diagnosis,
    write_improved_cut,
)
from millfrf.reports.diagnoses.cut_and_robot_pages import write_cut_report
from millfrf.reports.results_page import FigureFiles
from millfrf.reports.tables import evidence_in_words

from .answers import stored_answer
from .diagnose import diagnosing, refuse_file
from .given import FigureFormat, Figures, ModelGiven, files_among, model_of

FILES = ("diagnosis.json", "improved_cut.toml", "report.html")  # files that a diagnosis writes into its folder

# Unit and factor from SI of printed numbers
UNITS = {"radial_offset_m": ("µm", 1e6), "angle_rad": ("deg", 180 / math.pi), "coefficient_n_per_m": ("kN/m", 1e-3)}


def summary(diagnosis: CutDiagnosis) -> list[str]:
    """Summarise a diagnosis in a few lines, for the terminal and the head of the report."""
    errors = diagnosis.improvement
    lines = [f"verdict: {diagnosis.verdict}", _sentence(diagnosis), *(describe(cause) for cause in diagnosis.physics)]
    if diagnosis.equivalents:
        lines.append(f"cannot be distinguished from: {', '.join(diagnosis.equivalents)}")
    chatter = diagnosis.details.chatter
    lines += [f"{cut.name}: {cut.kind}, {cut.reason}" for cut in chatter if cut.unstable]
    lines += [f"chatter of {cut.name} was not judged: {cut.reason}" for cut in chatter if cut.kind == "not judged"]
    lines += [
        f"{candidate.name} was {candidate.stage}" for candidate in diagnosis.candidates if candidate.stage != "fitted"
    ]
    lines.append(remaining(diagnosis))
    changed = f", {100 * errors.after:.3g} % with it" if diagnosis.details.final.freed else ""
    lines.append(
        f"error of the force on blocks of time held out: {100 * errors.before:.3g} % as computed, "
        f"{100 * errors.refitted:.3g} % with coefficients refitted{changed}; noise {100 * errors.noise_floor:.3g} %"
    )
    if diagnosis.details.final.freed:
        lines.append(f"that the causes do not lower it has p = {errors.p_value:.1g}")
    return lines


def remaining(diagnosis: CutDiagnosis) -> str:
    """Sentence on the residual above noise, and on the largest one for the verdicts none and explained."""
    return (
        f"residual: {100 * diagnosis.leftover:.2g} % of its power exceeds noise and usual error; "
        f"none and explained: at most {100 * diagnosis.details.settings.verdict.noise_like:g} %"
    )


def describe(cause: AcceptedCause) -> str:
    """One cause with its numbers, in a user's units."""
    if cause.name == COEFFICIENTS:
        names = cause.location["coefficients"]
        numbers = [f"{name} {cause.parameters[name]:.4g} ± {cause.standard_errors[name]:.2g}" for name in names]
    else:
        numbers = [
            number_in_words(name, value, cause.standard_errors[name]) for name, value in cause.parameters.items()
        ]
    return f"{cause.name}: {', '.join(numbers)}; {evidence_in_words(cause.evidence)}"


def number_in_words(name: str, value: float, error: float) -> str:
    """One number with its error and unit."""
    unit, factor = UNITS.get(name, ("", 1.0))
    text = with_error(factor * value, factor * error)
    return f"{name.rsplit('_', 1)[0] if unit else name} {text} {unit}".strip().replace("_n_per", "").replace("_", " ")


def _sentence(diagnosis: CutDiagnosis) -> str:
    unstable = [cut.name for cut in diagnosis.details.chatter if cut.unstable]
    if unstable:
        names = f"the recording {unstable[0]} chatters"
        if len(unstable) > 1:
            names = f"the recordings {', '.join(unstable)} chatter"
        return (
            f"cannot tell: {names}, and the force of a stable cut, which repeats with the spindle, does not apply; "
            "record a stable cut (less depth, another speed)"
        )
    return {
        "none": "the computed force agrees with the measured one within noise and a lab's errors: nothing to change",
        "unexplained": "the computed force is wrong in a way that no known cause explains",
        "partly explained": (
            "the causes below lower the error of the computed force on held-out blocks, but the residual is too large "
            "for an explanation: another cause is missing, and the numbers may be biased by it"
        ),
        "explained": "the computed force neglects the causes below; with them the residual is noise and usual error",
    }[diagnosis.verdict]


@step
def cut_diagnose(
    cutting: Annotated[File, Reads("CUT.toml")],
    /,
    *recordings: Annotated[File, Reads("REC...")],
    depth: Annotated[float, Typed("M")],
    out: Annotated[File | None, Writes("DIR", needed=True, files=FILES)] = None,
    speed: Annotated[float, Typed("RPM")] | None = None,
    model: ModelGiven | None = None,
    coefficient_error: Annotated[float, Gt(0), Lt(1)] = 0.15,
    force_error: Annotated[float, Gt(0), Lt(1)] = 0.01,
    stream: str | None = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> CutDiagnosis:
    """Find the physics that a computed cutting force neglects: runout, regenerative feedback, process damping.

    Parameters
    ----------
    cutting
        Cutter with straight edges, engagement and force coefficients.
    recordings
        Recordings of that cut.
    depth : m
        Axial depth of the cut.
    out
        Folder for the diagnosis, the improved cutting file and a report.
    speed : rpm
        Spindle speed within 2 %; without it the speed that the recording states.
    model
        Modal model with the receptance of the tip, if no motion was measured there.
    coefficient_error
        Uncertainty of a laboratory's force coefficients, as a share.
    force_error
        Uncertainty of each spectral line of a correct computed force, as a share.
    stream
        Sample clock; needed where a recording has several.
    figures
        Folder for each figure of the report as a file.
    figure_format
        Format of these files.

    Returns
    -------
    CutDiagnosis
        Verdict, causes with their evidence, errors on held-out blocks.

    Raises
    ------
    InputError
        Files that cannot be used together, or a folder that cannot be made.

    Examples
    --------
    ::

        $ millfrf cut diagnose cut.toml low.h5 high.h5 --depth 0.001 --out diagnosis
    """
    paths = [Path(recording) for recording in recordings]
    folder = None if out is None else Path(out)
    if folder is not None:
        refuse_file(folder)
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):
        raise InputError(f"recordings need different names to distinguish their results, not {', '.join(names)}")
    process, warnings = read_checked_cutting(cutting)
    warnings += _check_inputs(paths, process, depth, speed, stream)
    structure = None if model is None else model_of(model)[0]
    spindle_speed = None if speed is None else speed * math.pi / 30
    cuts = [read_cut_recording(path, process, speed=spindle_speed, model=structure, stream=stream) for path in paths]
    with diagnosing():
        diagnosis = diagnose_cut(process, depth, cuts, coefficient_error=coefficient_error, force_error=force_error)
    lines = summary(diagnosis)
    if folder is not None:
        figure_files = None if figures is None else FigureFiles(Path(figures), figure_format)
        options = {
            "depth": depth,
            "speed": speed,
            "model": model,
            "coefficient_error": coefficient_error,
            "force_error": force_error,
            "stream": stream,
        }
        made_of = origin("cut diagnose", files_among(cutting, *paths, model), options)
        with writing_whole_folder(folder) as unfinished:
            write_diagnosis(unfinished / FILES[0], diagnosis)
            write_improved_cut(unfinished / FILES[1], diagnosis)
            add_to_json(unfinished / FILES[0], made_of)
            add_comment(unfinished / FILES[1], made_of)
            report_lines = [*lines, *(f"warning: {warning}" for warning in warnings)]
            with progress("writing the report"):
                write_cut_report(unfinished / FILES[2], diagnosis, Path(cutting).name, report_lines, figure_files)
        tell(lambda: {"diagnosis": stored_answer(folder / FILES[0])})
    for line in lines:
        say(line)
    warn(warnings)
    if folder is not None:
        say(f"wrote {', '.join(str(folder / name) for name in FILES)}")
    return diagnosis


def _check_inputs(
    paths: Sequence[Path], process: MillingProcess, depth: float, speed: float | None, stream: str | None
) -> list[str]:
    """Check depth, speed, memory and recordings; return warnings."""
    warnings = check_depth(depth, process, "depth")
    measured = []
    for path in paths:
        with opened(path) as recording:
            warnings += check_one_speed(recording.path.name, recording.setup, process, speed)
            kinds = {channel.quantity for channel in recording.stream(stream).channels}
        require_room_for_cut(path, process, stream)
        if "force" in kinds and kinds & {"acceleration", "velocity", "displacement"}:
            measured.append(path)  # the reader of cuts reports the channels that the others lack
    if not measured:
        return warnings
    return warnings + check_recordings(measured, stream=stream, remedy=RECORD_AGAIN)
