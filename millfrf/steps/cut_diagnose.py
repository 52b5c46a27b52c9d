"""Step ``cut diagnose``: what a computed cutting force leaves out."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from annotated_types import Gt, Lt

from acquisition import opened
from millfrf.core import InputError, writing_whole_folder
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
from millfrf.reports.tables import evidence_in_words, with_error

from .answers import stored_answer
from .diagnose import refuse_file
from .given import FigureFormat, Figures, ModelGiven, files_among, model_of

FILES = ("diagnosis.json", "improved_cut.toml", "report.html")
"""Files that a diagnosis writes into its folder."""

UNITS = {"radial_offset_m": ("µm", 1e6), "angle_rad": ("deg", 180 / math.pi), "coefficient_n_per_m": ("kN/m", 1e-3)}
"""How numbers are told to a reader: unit and factor from SI."""


def summary(found: CutDiagnosis) -> list[str]:
    """A few lines for the terminal and the head of the report."""
    better = found.improvement
    lines = [f"verdict: {found.verdict}", _sentence(found), *(describe(cause) for cause in found.physics)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}")
    chatter = found.details.chatter
    lines += [f"{one.name}: {one.kind}, {one.reason}" for one in chatter if one.unstable]
    lines += [f"chatter of {one.name} was not judged: {one.reason}" for one in chatter if one.kind == "not judged"]
    lines += [f"{one.name} was {one.stage}" for one in found.candidates if one.stage != "fitted"]
    lines.append(what_is_left(found))
    changed = f", {100 * better.after:.3g} % with it" if found.details.final.freed else ""
    lines.append(
        f"error of the force on blocks of time held out: {100 * better.before:.3g} % as computed, "
        f"{100 * better.refitted:.3g} % with coefficients refitted{changed}; noise {100 * better.noise_floor:.3g} %"
    )
    if found.details.final.freed:
        lines.append(f"that the causes do not lower it has p = {better.p_value:.1g}")
    return lines


def what_is_left(found: CutDiagnosis) -> str:
    """State the part of the force that stands out of noise, beside the part that may stand out."""
    return (
        f"left: {100 * found.leftover:.2g} % of the residual's power stands out of noise and usual error; "
        f"none and explained: at most {100 * found.details.settings.verdict.noise_like:g} %"
    )


def describe(cause: AcceptedCause) -> str:
    """One cause with its numbers, in a user's units."""
    if cause.name == COEFFICIENTS:
        names = cause.location["coefficients"]
        numbers = [f"{name} {cause.parameters[name]:.4g} ± {cause.standard_errors[name]:.2g}" for name in names]
    else:
        numbers = [told(name, value, cause.standard_errors[name]) for name, value in cause.parameters.items()]
    return f"{cause.name}: {', '.join(numbers)}; {evidence_in_words(cause.evidence)}"


def told(name: str, value: float, error: float) -> str:
    """One number with its error and unit."""
    unit, factor = UNITS.get(name, ("", 1.0))
    text = with_error(factor * value, factor * error)
    return f"{name.rsplit('_', 1)[0] if unit else name} {text} {unit}".strip().replace("_n_per", "").replace("_", " ")


def _sentence(found: CutDiagnosis) -> str:
    shaken = [one for one in found.details.chatter if one.unstable]
    if shaken:
        names = f"the recording {shaken[0].name} chatters"
        if len(shaken) > 1:
            names = f"the recordings {', '.join(one.name for one in shaken)} chatter"
        return (
            f"cannot tell: {names}, and the force of a stable cut, which repeats with the spindle, does not apply; "
            "record a stable cut (less depth, another speed)"
        )
    return {
        "none": "the computed force agrees with the measured one within noise and a lab's errors: nothing to change",
        "unexplained": "the computed force is wrong in a way that no known cause explains",
        "partly explained": (
            "what follows lowers the error of the computed force on blocks held out, but leaves more than an "
            "explanation may: something else is wrong too, and the numbers may stand in for it"
        ),
        "explained": "the computed force leaves out what follows; what is then left is noise and usual error",
    }[found.verdict]


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
    """Which physics does the computed cutting force leave out: runout, regenerative feedback, process damping?

    Parameters
    ----------
    cutting
        Cutter, engagement and force coefficients.
    recordings
        Recordings of that cut.
    depth : m
        Axial depth of the cut.
    out
        Folder for the diagnosis, the improved cutting file and a report.
    speed : rpm
        Spindle speed within 2 %; without it as the recording states it.
    model
        Receptance of the tip, where no motion was measured there.
    coefficient_error
        Uncertainty of a laboratory's force coefficients, as a share.
    force_error
        Uncertainty of each line of a right computed force, as a share.
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
    process, doubts = read_checked_cutting(cutting)
    doubts += _checked(paths, process, depth, speed, stream)
    structure = None if model is None else model_of(model)[0]
    turning = None if speed is None else speed * math.pi / 30
    cuts = [read_cut_recording(path, process, speed=turning, model=structure, stream=stream) for path in paths]
    with progress("diagnosing"):
        found = diagnose_cut(process, depth, cuts, coefficient_error=coefficient_error, force_error=force_error)
    lines = summary(found)
    if folder is not None:
        drawn = None if figures is None else FigureFiles(Path(figures), figure_format)
        asked = {
            "depth": depth,
            "speed": speed,
            "model": model,
            "coefficient_error": coefficient_error,
            "force_error": force_error,
            "stream": stream,
        }
        made_of = origin("cut diagnose", files_among(cutting, *paths, model), asked)
        with writing_whole_folder(folder) as unfinished:
            write_diagnosis(unfinished / FILES[0], found)
            write_improved_cut(unfinished / FILES[1], found)
            add_to_json(unfinished / FILES[0], made_of)
            add_comment(unfinished / FILES[1], made_of)
            warned = [*lines, *(f"warning: {doubt}" for doubt in doubts)]
            with progress("writing the report"):
                write_cut_report(unfinished / FILES[2], found, Path(cutting).name, warned, drawn)
        tell(lambda: {"diagnosis": stored_answer(folder / FILES[0])})
    for line in lines:
        say(line)
    warn(doubts)
    if folder is not None:
        say(f"wrote {', '.join(str(folder / name) for name in FILES)}")
    return found


def _checked(
    paths: Sequence[Path], process: MillingProcess, depth: float, speed: float | None, stream: str | None
) -> list[str]:
    """Judge what was typed and the recordings; doubts."""
    doubts = check_depth(depth, process, "depth")
    judged = []
    for path in paths:
        with opened(path) as recording:
            doubts += check_one_speed(recording.path.name, recording.setup, process, speed)
            kinds = {channel.quantity for channel in recording.stream(stream).channels}
        require_room_for_cut(path, process, stream)
        if "force" in kinds and kinds & {"acceleration", "velocity", "displacement"}:
            judged.append(path)  # what the others lack is said where it is needed
    if not judged:
        return doubts
    return doubts + check_recordings(judged, stream=stream, remedy=RECORD_AGAIN)
