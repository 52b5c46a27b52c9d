"""The step from a cutting file and recordings of the cut to a diagnosis, the improved file and a report."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from acquisition import Recording
from millfrf.core import InputError, writing_whole_folder
from millfrf.cutting import MillingProcess
from millfrf.mismatch import diagnose_cut, read_cut_recording, require_room_for_cut, write_diagnosis, write_improved_cut
from modal_fit import read_modal_model

from ..gate import RECORD_AGAIN, check_depth, check_one_speed, check_recordings, read_checked_cutting
from ..progress import bar
from ..provenance import add_comment, add_to_json, origin
from ..report import FigureFiles, write_cut_report
from ..result_folder import refuse_file
from .diagnosis_words import summary


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
