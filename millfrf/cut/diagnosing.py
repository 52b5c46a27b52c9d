"""From a cutting file and recordings of the cut to a folder with the diagnosis, the improved file and a report."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from acquisition import Recording
from cutting import MillingProcess
from foundation import InputError
from mismatch import AcceptedCause
from mismatch.cutting_causes import (
    COEFFICIENTS,
    CutDiagnosis,
    diagnose_cut,
    read_cut_recording,
    write_cut_diagnosis,
    write_improved_cut,
)
from modal_fit import read_modal_model

from ..gate import check_depth, check_one_speed, check_recordings, read_checked_cutting
from ..progress import bar
from ..report.cut_diagnosis_page import write_cut_report
from ..result_folder import refuse_file
from ..tables import with_error

UNITS = {"radial_offset_m": ("µm", 1e6), "angle_rad": ("deg", 180 / math.pi), "coefficient_n_per_m": ("kN/m", 1e-3)}
"""How numbers are told to a reader: unit and factor from SI."""


@dataclass(frozen=True)
class Asking:
    """Options of a cutting diagnosis as they were typed; None where left out."""

    depth: float
    speed: float | None
    model: Path | None
    coefficient_error: float
    force_error: float
    stream: str | None


def diagnose_cut_files(cutting: Path, paths: Sequence[Path], out: Path, asking: Asking) -> list[str]:
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
    out.mkdir(parents=True, exist_ok=True)
    write_cut_diagnosis(out / "diagnosis.json", found)
    write_improved_cut(out / "improved_cut.toml", found)
    lines = [*summary(found), *(f"warning: {doubt}" for doubt in doubts)]
    with bar("writing the report"):
        write_cut_report(out / "report.html", found, cutting.name, lines)
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
        if "force" in kinds and kinds & {"acceleration", "velocity", "displacement"}:
            judged.append(path)  # what the others lack is said where it is needed
    return doubts + (check_recordings(judged, stream=asking.stream, watch=bar) if judged else [])


def summary(found: CutDiagnosis) -> list[str]:
    """A few lines for the terminal and the head of the report."""
    better = found.improvement
    lines = [f"verdict: {found.verdict}", _sentence(found), *(describe(cause) for cause in found.physics)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}")
    lines += [f"{one.name} was {one.stage}" for one in found.candidates if one.stage != "fitted"]
    changed = "" if found.verdict == "unexplained" or not found.final.freed else f", {100 * better.after:.3g} % with it"
    lines.append(
        f"error of the force on blocks of time held out: {100 * better.before:.3g} % as computed, "
        f"{100 * better.refitted:.3g} % with coefficients refitted{changed}; noise {100 * better.noise_floor:.3g} %"
    )
    return lines


def describe(cause: AcceptedCause) -> str:
    """One cause with its numbers, in a user's units."""
    if cause.name == COEFFICIENTS:
        names = cause.location["coefficients"]
        numbers = [f"{name} {cause.parameters[name]:.4g} ± {cause.standard_errors[name]:.2g}" for name in names]
    else:
        numbers = [told(name, value, cause.standard_errors[name]) for name, value in cause.parameters.items()]
    return f"{cause.name}: {', '.join(numbers)}; evidence {cause.evidence:.0f}"


def told(name: str, value: float, error: float) -> str:
    """One number with its error and unit."""
    unit, factor = UNITS.get(name, ("", 1.0))
    text = with_error(factor * value, factor * error)
    return f"{name.rsplit('_', 1)[0] if unit else name} {text} {unit}".strip().replace("_n_per", "").replace("_", " ")


def _sentence(found: CutDiagnosis) -> str:
    left = 100 * found.leftover
    if found.verdict == "none":
        return "the computed force agrees with the measured one within noise and a lab's errors: nothing to change"
    if found.verdict == "unexplained":
        return (
            f"the computed force is wrong in a way that no known cause explains; {left:.0f} % of the error stands out"
        )
    return f"the computed force leaves out what follows; {left:.0f} % of the error still stands out of the noise"
