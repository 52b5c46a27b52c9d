"""Step ``cut diagnose``: what a computed cutting force leaves out."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from acquisition import Recording
from millfrf.core import InputError, writing_whole_folder
from millfrf.core.progress import bar
from millfrf.core.provenance import add_comment, add_to_json, origin
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
from millfrf.report.diagnoses.cut_and_robot_pages import write_cut_report
from millfrf.report.results_page import FigureFiles
from millfrf.report.tables import evidence_in_words, with_error
from modal_fit import read_modal_model

from .result_folder import refuse_file

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


@dataclass(frozen=True)
class Asking:
    """Options of a cutting diagnosis as they were typed; None where left out."""

    depth: float
    speed: float | None
    model: Path | None
    coefficient_error: float
    force_error: float
    stream: str | None


def diagnose_cut_files(
    cutting: Path, paths: Sequence[Path], out: Path, asking: Asking, figures: FigureFiles | None = None
) -> list[str]:
    """Diagnose, write ``diagnosis.json``, ``improved_cut.toml`` and ``report.html``; lines that sum it up.

    Raises
    ------
    InputError
        Files that cannot be used together, or a folder that cannot be made.
    """
    refuse_file(out)
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):
        raise InputError(f"recordings need different names to tell their results apart, not {', '.join(names)}")
    process, doubts = read_checked_cutting(cutting)
    doubts += _checked(paths, process, asking)
    model = None if asking.model is None else read_modal_model(asking.model)
    speed = None if asking.speed is None else asking.speed * math.pi / 30
    recordings = [read_cut_recording(path, process, speed=speed, model=model, stream=asking.stream) for path in paths]
    with bar("diagnosing"):
        found = diagnose_cut(
            process,
            asking.depth,
            recordings,
            coefficient_error=asking.coefficient_error,
            force_error=asking.force_error,
        )
    lines = [*summary(found), *(f"warning: {doubt}" for doubt in doubts)]
    with writing_whole_folder(out) as folder:
        write_diagnosis(folder / "diagnosis.json", found)
        write_improved_cut(folder / "improved_cut.toml", found)
        made_of = origin("cut diagnose", [cutting, *paths, *([asking.model] if asking.model else [])], asdict(asking))
        add_to_json(folder / "diagnosis.json", made_of)
        add_comment(folder / "improved_cut.toml", made_of)
        with bar("writing the report"):
            write_cut_report(folder / "report.html", found, cutting.name, lines, figures)
    written = ", ".join(str(out / name) for name in ("diagnosis.json", "improved_cut.toml", "report.html"))
    return [*lines, f"wrote {written}"]


def _checked(paths: Sequence[Path], process: MillingProcess, asking: Asking) -> list[str]:
    """Judge what was typed and the recordings; doubts."""
    doubts = check_depth(asking.depth, process, "depth")
    for name, share in (("--coefficient-error", asking.coefficient_error), ("--force-error", asking.force_error)):
        if not 0 < share < 1:
            raise InputError(f"{name} {share:g} must be a share above 0 and below 1, for example {share / 100:g}")
    judged = []
    for path in paths:
        with Recording(path) as recording:
            doubts += check_one_speed(recording.path.name, recording.setup, process, asking.speed)
            kinds = {channel.quantity for channel in recording.stream(asking.stream).channels}
        require_room_for_cut(path, process, asking.stream)
        if "force" in kinds and kinds & {"acceleration", "velocity", "displacement"}:
            judged.append(path)  # what the others lack is said where it is needed
    if not judged:
        return doubts
    return doubts + check_recordings(judged, stream=asking.stream, progress=bar, remedy=RECORD_AGAIN)
