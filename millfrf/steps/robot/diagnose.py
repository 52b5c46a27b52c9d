"""Step ``robot diagnose``: what is wrong with a robot's model."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from h5py import is_hdf5

from millfrf.core import InputError, Real, writing_whole_folder
from millfrf.core.file_kinds import FRF, MODEL, kind_of
from millfrf.core.progress import bar
from millfrf.core.provenance import add_to_json, origin
from millfrf.gate import RECORD_AGAIN, check_channels
from millfrf.mismatch import (
    ROBOT,
    AcceptedCause,
    CompanionNumber,
    LabError,
    PosedRecording,
    RobotDiagnosis,
    companions_of,
    diagnose_robot,
    number_of,
    posed_channels,
    read_posed,
    write_diagnosis,
)
from millfrf.options import check_band
from millfrf.report.diagnoses.robot_words import UNITS, refusal, told_number
from millfrf.report.tables import evidence_in_words, with_error
from millfrf.robot_model import SpatialCase, close_loops, model_of_modes, modes_at, read_robot, tool_down
from modal_fit import write_modal_model

from ..result_folder import refuse_file
from .postures import Asked, posture_of, spatial

if TYPE_CHECKING:
    from millfrf.report.results_page import FigureFiles


SENTENCES = {
    "none": "the robot's model agrees with the recordings as well as such a model can: nothing to change",
    "unexplained": (
        "the robot's model is wrong in a way that none of the changes explains, and so nothing is told of a cause"
    ),
    "class": "one of several changes explains the recordings; they cannot say which",
    "partly explained": (
        "changes lower the error on recordings left out, but leave more than an explanation may, or raise it on one of "
        "them: something else is wrong too, and the numbers may stand in for it"
    ),
}


def summary(found: RobotDiagnosis) -> list[str]:
    """A few lines for the terminal and the head of the report."""
    lines = [f"verdict: {found.verdict}", _sentence(found)]
    for cause in found.physics:
        lines += [describe(cause), *_beside(cause)]
    if found.equivalents:
        lines.append(f"cannot be told from: {', '.join(found.equivalents)}; record in another posture")
    if found.physics or found.verdict == "unexplained":
        lines.append(what_is_left(found))
    for one in found.held_out:
        changed = f"{100 * one.after:.3g} % changed, " if found.physics else ""
        lines.append(
            f"error on {one.name}, held out: {100 * one.before:.3g} % as modelled, {changed}"
            f"{100 * one.floor:.3g} % with modes fitted freely"
        )
    if found.physics:
        lines.append(f"that the change does not lower the error held out has p = {found.improvement.p_value:.1g}")
    else:
        lines += [f"{one.name} was fitted, but {refusal(one)}" for one in found.candidates if refusal(one)]
    return lines


def what_is_left(found: RobotDiagnosis) -> str:
    """State what is left, beside what may be left for `explained`."""
    limits, share = ROBOT.verdict, found.after.size / max(found.before.size, 1e-300)
    return (
        f"left: {100 * share:.2g} % of what the model leaves beyond noise, {found.after.share:.2g} times what a right "
        f"model's modes are off; explained: at most {100 * (1 - limits.explained):.0f} % or {limits.noise_like:g} times"
    )


def describe(cause: AcceptedCause) -> str:
    """One cause with its number, in a user's units."""
    number, unit = told_number(cause)
    what = f"times {number}" if not unit else f"{number} {unit}"
    lighter = " (lighter than modelled)" if cause.location["kind"] == "payload" and number_of(cause) < 0 else ""
    return f"{cause.name}: {what}{lighter}; {evidence_in_words(cause.evidence)}"


def _beside(cause: AcceptedCause) -> list[str]:
    """Companions that the recordings tell; a sentence on a place that they do not tell."""
    lines = [f"  {cause.name}, {_companion(one)}" for one in companions_of(cause) if one.told]
    hidden = [one.name.removesuffix(" from the tip") for one in companions_of(cause) if not one.told]
    if hidden and cause.location["kind"] == "payload":
        lines.append(
            f"  {cause.name}: mass and {', '.join(hidden)} cannot be told apart by these recordings; "
            "the error of the mass holds this; --payload-at X Y Z states the place"
        )
    return lines


def _companion(one: CompanionNumber) -> str:
    unit, factor = UNITS.get(one.unit, (one.unit, 1.0))
    return f"{one.name}: {with_error(factor * one.number, factor * one.standard_error)} {unit}"


def _sentence(found: RobotDiagnosis) -> str:
    if found.verdict != "explained":
        return SENTENCES[found.verdict]
    return (
        "one change explains the recordings and stands alone" if len(found.physics) == 1 else "two changes together do"
    )


LOWEST, HIGHEST = 0.4, 1.3
"""Band that is compared where none is given: from so many times the first mode to so many times the fourth."""


@dataclass(frozen=True)
class Asking:
    """Options of a robot's diagnosis as they were typed; None where left out."""

    poses: tuple[str, ...]
    feed: float | None
    band: tuple[float, float] | None
    sensor: tuple[float, float, float] | None
    payload_at: tuple[float, float, float] | None
    rigid_links: bool
    error: LabError
    stream: str | None


def diagnose_robot_files(
    robot: str,
    paths: Sequence[Path],
    out: Path,
    asking: Asking,
    *,
    dated: bool = True,
    figures: "FigureFiles | None" = None,
) -> list[str]:
    """Diagnose, write ``robot_diagnosis.json``, ``model_<recording>.json`` and ``report.html``; lines that sum it up.

    A report that is not ``dated`` does not tell when it was written, so that equal input gives equal bytes. With
    ``figures`` each of its figures becomes a file too.

    Raises
    ------
    InputError
        Files that cannot be used together, or a folder that cannot be made.
    """
    from millfrf.report.diagnoses.cut_and_robot_pages import (
        write_robot_report,  # the report asks this room for its words
    )

    refuse_file(out)
    case = spatial(read_robot(robot))
    _refuse_unlike(paths, asking)
    _refuse_what_an_update_takes(paths)
    doubts = _doubts(paths, asking.stream)
    recordings = _recordings(case, paths, asking)
    with bar("diagnosing"):
        found = diagnose_robot(
            case.robot,
            recordings,
            rigid_links=asking.rigid_links,
            payload_at=_place(asking.payload_at),
            sensor=_place(asking.sensor),
            error=asking.error,
        )
    found = replace(found, doubts=tuple(doubts))
    lines = summary(found)
    improved, offset = found.details.improved_robot()
    with writing_whole_folder(out) as folder:
        write_diagnosis(folder / "robot_diagnosis.json", found)
        for recording in recordings:
            modes = modes_at(improved, recording.q + offset)
            top = 3 * float(recording.spectrum.frequencies[-1])
            model = model_of_modes(modes, improved, axes=recording.axes, highest_frequency=top)
            write_modal_model(folder / f"model_{recording.name}.json", model)
        for path in folder.glob("*.json"):
            add_to_json(path, origin("robot diagnose", [robot, *paths], asdict(asking)))
        with bar("writing the report"):
            write_robot_report(folder / "report.html", found, case.name, lines, dated=dated, figures=figures)
    lines += [f"warning: {doubt}" for doubt in doubts]
    return [*lines, f"wrote {out / 'robot_diagnosis.json'}, {out / 'report.html'} and a model for each recording"]


def _doubts(paths: Sequence[Path], stream: str | None) -> list[str]:
    """Judge each recording alone: a force that rests in one posture tells nothing there of the robot."""
    return [
        doubt
        for path in paths
        for doubt in check_channels([path], posed_channels, stream, progress=bar, remedy=RECORD_AGAIN)
    ]


def _refuse_what_an_update_takes(paths: Sequence[Path]) -> None:
    for path in paths:
        if path.suffix == ".json" or (path.is_file() and is_hdf5(path)):
            kind = kind_of(path)
            if kind in (FRF, MODEL):
                raise InputError(
                    f"{path} is of the kind {kind}; this command reads recordings; 'millfrf robot update' takes FRFs "
                    "and modal models, says which numbers of the robot's file are wrong, and writes them"
                )


def _refuse_unlike(paths: Sequence[Path], asking: Asking) -> None:
    """One posture a recording, one name a recording, and all of them there."""
    if len(asking.poses) != len(paths):
        raise InputError(
            f"{len(asking.poses)} postures for {len(paths)} recordings; give --pose once for each, in the same order"
        )
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):
        raise InputError(f"recordings need different names to tell their results apart, not {', '.join(names)}")
    for path in paths:
        if not path.is_file():
            raise InputError(f"no file {path}; check the name")


def _recordings(case: SpatialCase, paths: Sequence[Path], asking: Asking) -> list[PosedRecording]:
    axes = np.eye(3) if asking.feed is None else tool_down([0.0, 0.0, 0.0], np.radians(asking.feed)).axes
    postures = [close_loops(case.robot.mechanism, _driven(case, pose)) for pose in asking.poses]
    band = check_band(asking.band) or _band(case, postures)
    recordings = []
    for path, q in zip(paths, postures, strict=True):
        model = model_of_modes(modes_at(case.robot, q), case.robot, highest_frequency=band[1])
        if not len(model.poles):
            raise InputError(f"{path.name}: the robot has no damped mode below {band[1]:g} Hz; raise --band LO HI")
        recordings.append(read_posed(path, q, model, band, axes=axes, stream=asking.stream))
    return recordings


def _driven(case: SpatialCase, pose: str) -> Real:
    """Driven joint values of a name, or of degrees with commas."""
    asked = Asked(joints=pose) if "," in pose else Asked(pose=pose)
    return posture_of(case, asked)[0]


def _band(case: SpatialCase, postures: Sequence[Real]) -> tuple[float, float]:
    frequencies = [modes_at(case.robot, q).frequencies for q in postures]
    return (
        LOWEST * min(float(one[0]) for one in frequencies),
        HIGHEST * max(float(one[min(3, len(one) - 1)]) for one in frequencies),
    )


def _place(given: tuple[float, float, float] | None) -> Real | None:
    return None if given is None else np.array(given)
