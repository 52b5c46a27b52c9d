"""Step ``robot diagnose``: which numbers of a robot's model are wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from h5py import is_hdf5

from millfrf.core import InputError, Real, with_error, writing_whole_folder
from millfrf.core.progress import progress
from millfrf.core.provenance import add_to_json, origin
from millfrf.core.steps import Band, File, Reads, Shares, Writes, step
from millfrf.core.terminal import say, say_written, tell, warn
from millfrf.gate import RECORD_AGAIN, FileKind, check_channels, kind_of
from millfrf.mismatch import (
    ROBOT,
    AcceptedCause,
    CompanionNumber,
    LabError,
    PosedRecording,
    RobotDiagnosis,
    companions_of,
    number_of,
    posed_channels,
    read_posed,
    write_diagnosis,
)
from millfrf.mismatch import diagnose_robot as diagnose_model
from millfrf.reports.diagnoses.cut_and_robot_pages import UNITS, number_and_unit, refusal, write_robot_report
from millfrf.reports.results_page import FigureFiles
from millfrf.reports.tables import evidence_in_words
from millfrf.robot_model import SpatialCase, close_loops, model_of_modes, modes_at, read_robot
from modal_fit import write_modal_model

from ..answers import stored_answer
from ..diagnose import check_shares, refuse_file
from ..given import Degrees, FigureFormat, Figures, NearTip, Poses, Robot
from .postures import axes_turned, band_of_modes, driven_of_each, spatial

# Files that a diagnosis writes into its folder, besides a model for each recording
FILES = ("robot_diagnosis.json", "report.html")


@step
def diagnose_robot(
    robot: Robot,
    /,
    *recordings: Annotated[File, Reads("REC")],
    poses: Poses = (),
    out: Annotated[File | None, Writes("DIR", needed=True, files=FILES)] = None,
    channels_turned: Degrees | None = None,
    band: Band | None = None,
    sensor_at: NearTip = None,
    payload_at: NearTip = None,
    rigid_links: bool = False,
    model_error: Shares = (0.01, 0.15, 0.05),
    stream: str | None = None,
    figures: Figures = None,
    figure_format: FigureFormat = "svg",
) -> RobotDiagnosis:
    """Find the wrong numbers of a robot's model: joint stiffness, link flexibility, payload, tool, posture, damping.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    recordings
        Recordings, best in several postures.
    poses
        Posture of each recording in turn: a name of the robot's file, or DEG,DEG,...
    out
        Folder for the diagnosis, a model for each recording and a report.
    channels_turned : deg
        Angle of channel X from the base's x, with Z up; without it the axes of the base.
    band : Hz
        Band that is compared; without it 0.4 times the first to 1.3 times the fourth natural frequency.
    sensor_at : m
        Place of the housing sensor from the tip, in the channels' axes.
    payload_at : m
        Place of a payload from the tip, in the tool frame; without it the place is fitted.
    rigid_links
        Start from a model with rigid links, to test whether their flexibility is missing.
    model_error
        Errors of a correct model, as shares: frequency, damping, shapes; one number applies to all.
    stream
        Sample clock; needed where a recording has several.
    figures
        Folder for each figure of the report as a file.
    figure_format
        Format of these files.

    Returns
    -------
    RobotDiagnosis
        Verdict, changes with their evidence, errors on held-out data, and the warnings.

    Raises
    ------
    InputError
        Another number of postures than of recordings, files that cannot be used together, or a folder that cannot be
        made.

    Examples
    --------
    ::

        $ millfrf robot diagnose robot.toml a.h5 b.h5 --pose home --pose 0,-10,100,0,90,0 --out found
    """
    check_shares("model-error", model_error, (0.01, 0.15, 0.05))
    figure_files = None if figures is None else FigureFiles(Path(figures), figure_format)
    if out is not None:
        refuse_file(Path(out))
    case, paths = spatial(read_robot(robot)), [Path(recording) for recording in recordings]
    driven = driven_of_each(case, poses, len(paths), "recordings")
    _refuse_unusable(paths)
    # each recording alone: a force that is zero in one posture gives no information there
    warnings = [
        doubt for path in paths for doubt in check_channels([path], posed_channels, stream, remedy=RECORD_AGAIN)
    ]
    postures = [close_loops(case.robot.mechanism, values) for values in driven]
    band = band or band_of_modes(case.robot, postures, n_modes=4)
    axes = axes_turned(channels_turned)
    posed = [_read(case, path, q, band, axes, stream) for path, q in zip(paths, postures, strict=True)]
    with progress("diagnosing"):
        diagnosis = diagnose_model(
            case.robot,
            posed,
            rigid_links=rigid_links,
            payload_at=None if payload_at is None else np.array(payload_at),
            sensor=None if sensor_at is None else np.array(sensor_at),
            error=LabError(*model_error),
        )
    diagnosis = replace(diagnosis, doubts=tuple(warnings))
    for line in summary(diagnosis):
        say(line)
    warn(warnings)
    if out is not None:
        folder = Path(out)
        options = {"poses": poses, "channels_turned_deg": channels_turned, "band_hz": band, "sensor_at_m": sensor_at}
        options |= {"payload_at_m": payload_at, "rigid_links": rigid_links, "error": model_error, "stream": stream}
        made_of = origin("robot diagnose", [robot, *paths], options)
        write_robot_diagnosis(folder, diagnosis, case.name, made_of, figures=figure_files)
        tell(lambda: {"diagnosis": stored_answer(folder / FILES[0])})
        say_written([*(folder / name for name in FILES), "a model for each recording"])
    return diagnosis


def write_robot_diagnosis(
    folder: Path,
    diagnosis: RobotDiagnosis,
    robot_name: str,
    made_of: Mapping[str, Any],
    *,
    dated: bool = True,
    figures: FigureFiles | None = None,
) -> None:
    """Write diagnosis, improved model for each recording, and report into a folder.

    Without ``dated`` the report has no time, so that equal input gives equal bytes.
    """
    improved, offset = diagnosis.details.improved_robot()
    with writing_whole_folder(folder) as unfinished:
        write_diagnosis(unfinished / FILES[0], diagnosis)
        for recording in diagnosis.details.robot.recordings:
            modes = modes_at(improved, recording.q + offset)
            top = 3 * float(recording.spectrum.frequencies[-1])
            model = model_of_modes(modes, improved, axes=recording.axes, highest_frequency=top)
            write_modal_model(unfinished / f"model_{recording.name}.json", model)
        for path in unfinished.glob("*.json"):
            add_to_json(path, made_of)
        lines = summary(diagnosis)
        with progress("writing the report"):
            write_robot_report(unfinished / FILES[1], diagnosis, robot_name, lines, dated=dated, figures=figures)


def _refuse_unusable(paths: Sequence[Path]) -> None:
    """Refuse recordings with equal names, missing files, and FRFs and models, which ``robot update`` reads."""
    names = [path.stem for path in paths]
    if len(set(names)) < len(names):
        raise InputError(f"recordings need different names to distinguish their results, not {', '.join(names)}")
    for path in paths:
        if not path.is_file():
            raise InputError(f"no file {path}; check the name")
        kind = kind_of(path) if path.suffix == ".json" or is_hdf5(path) else ""
        if kind in (FileKind.FRF, FileKind.MODEL):
            raise InputError(
                f"{path} is of the kind {kind}; this command reads recordings; 'millfrf robot update' takes FRFs "
                "and modal models, says which numbers of the robot's file are wrong, and writes them"
            )


def _read(
    case: SpatialCase, path: Path, q: Real, band: tuple[float, float], axes: Real, stream: str | None
) -> PosedRecording:
    """Read a recording that was made in the posture with the joint values q."""
    model = model_of_modes(modes_at(case.robot, q), case.robot, highest_frequency=band[1])
    if not len(model.poles):
        raise InputError(f"{path.name}: the robot has no damped mode below {band[1]:g} Hz; raise --band LO HI")
    return read_posed(path, q, model, band, axes=axes, stream=stream)


SENTENCES = {
    "none": "the robot's model agrees with the recordings as well as such a model can: nothing to change",
    "unexplained": ("the robot's model is wrong in a way that none of the changes explains, and so no cause is named"),
    "class": "one of several changes explains the recordings; they cannot say which",
    "partly explained": (
        "changes lower the error on held-out recordings, but the residual is too large for an explanation, or the "
        "error rises on one of them: another cause is missing, and the numbers may be biased by it"
    ),
}


def summary(diagnosis: RobotDiagnosis) -> list[str]:
    """Summarise a diagnosis in a few lines, for the terminal and the head of the report."""
    lines = [f"verdict: {diagnosis.verdict}", _sentence(diagnosis)]
    for cause in diagnosis.physics:
        lines += [describe(cause), *_companions(cause)]
    if diagnosis.equivalents:
        lines.append(f"cannot be distinguished from: {', '.join(diagnosis.equivalents)}; record in another posture")
    if diagnosis.physics or diagnosis.verdict == "unexplained":
        lines.append(_remaining(diagnosis))
    for error in diagnosis.held_out:
        changed = f"{100 * error.after:.3g} % changed, " if diagnosis.physics else ""
        lines.append(
            f"error on {error.name}, held out: {100 * error.before:.3g} % as modelled, {changed}"
            f"{100 * error.floor:.3g} % with modes fitted freely"
        )
    if diagnosis.physics:
        lines.append(f"that the change does not lower the error held out has p = {diagnosis.improvement.p_value:.1g}")
    else:
        refused = [(candidate.name, refusal(candidate)) for candidate in diagnosis.candidates]
        lines += [f"{name} was fitted, but {reason}" for name, reason in refused if reason]
    return lines


def _remaining(diagnosis: RobotDiagnosis) -> str:
    """Describe the remaining error, and the largest error for which the verdict is `explained`."""
    limits, share = ROBOT.verdict, diagnosis.after.size / max(diagnosis.before.size, 1e-300)
    most = 100 * (1 - limits.explained)
    return (
        f"residual beyond noise: {100 * share:.2g} % of that before, {diagnosis.after.share:.2g} times that of a "
        f"correct model; explained: at most {most:.0f} % or {limits.noise_like:g} times"
    )


def describe(cause: AcceptedCause) -> str:
    """Sentence on a cause and its number, in common units."""
    number, unit = number_and_unit(cause)
    what = f"times {number}" if not unit else f"{number} {unit}"
    lighter = " (lighter than modelled)" if cause.location["kind"] == "payload" and number_of(cause) < 0 else ""
    return f"{cause.name}: {what}{lighter}; {evidence_in_words(cause.evidence)}"


def _companions(cause: AcceptedCause) -> list[str]:
    """Describe the further numbers of a cause that the recordings determine, and a place that they do not determine."""
    companions = companions_of(cause)
    lines = [f"  {cause.name}, {_companion(number)}" for number in companions if number.determined]
    undetermined = [number.name.removesuffix(" from the tip") for number in companions if not number.determined]
    if undetermined and cause.location["kind"] == "payload":
        lines.append(
            f"  {cause.name}: mass and {', '.join(undetermined)} cannot be distinguished by these recordings; "
            "the error of the mass includes this; --payload-at X Y Z states the place"
        )
    return lines


def _companion(number: CompanionNumber) -> str:
    unit, factor = UNITS.get(number.unit, (number.unit, 1.0))
    return f"{number.name}: {with_error(factor * number.number, factor * number.standard_error)} {unit}"


def _sentence(diagnosis: RobotDiagnosis) -> str:
    if diagnosis.verdict != "explained":
        return SENTENCES[diagnosis.verdict]
    return "one change explains the recordings" if len(diagnosis.physics) == 1 else "two changes explain the recordings"
