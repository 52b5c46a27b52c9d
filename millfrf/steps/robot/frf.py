"""Step ``robot frf``: receptance at the tool tip in a posture."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le

from estimation import write_frf
from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.provenance import add_to_json, origin
from millfrf.core.steps import Band, File, Reads, Writes, step
from millfrf.core.terminal import say_written, show, tell, warn
from millfrf.figures import save_figure
from millfrf.robot_model import SpatialCase, cell_structure_at, in_posture, read_robot, shown_values
from modal_fit import ModalModel, write_modal_model

from ..answers import model_answer
from ..given import At, Degrees, Joints, NearTip, Picture, Pose, Robot, TableFile, Turning
from .learned import predicted_posture, table_of_modes, write_receptance_band
from .pictures import receptance_figure, write_receptance_table
from .postures import cut_place, mechanism_of, posture_of, spatial
from .uncertainty import with_errors

# Content of the file of a prediction from learned postures, by its suffix
STORED = {".json": "with covariance", ".h5": "the mean alone; .csv has its band", ".csv": "with its 95 % band"}


@step
def robot_frf(
    robot: Robot,
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".h5", ".json", ".csv"), needed=True)] = None,
    pose: Pose = None,
    joints: Joints = None,
    at: At = None,
    feed: Degrees = 0.0,
    turn: Degrees = 0.0,
    redundancy: Turning = "tool",
    links: bool = False,
    band: Band = (1.0, 100.0),
    lines: Annotated[int, Ge(2), Le(1_000_000)] = 1000,
    sensor_at: NearTip = None,
    learned: Annotated[File | None, Reads("POSTURES.json")] = None,
    picture: Picture = None,
    table: TableFile = None,
) -> ModalModel:
    """Receptance at the tool tip in a posture, as an FRF file or as the modal model behind it.

    Parameters
    ----------
    robot
        Robot file (.toml), or a name that `robot list` shows.
    out
        File to write: the FRF (.h5), the modal model (.json), or with --learned a band of the FRF (.csv).
    pose
        Posture named in the robot's file; without it the first one.
    joints : deg
        Values of the driven joints; of prismatic joints in metres.
    at : m
        Place of the tip of a vertical tool, instead of a posture.
    feed : deg
        Direction of the feed from the base's x, with --at.
    turn : deg
        Turn of the redundancy, with --at.
    redundancy
        What turns, with --at: the robot about the tool's axis (tool), or tool and workpiece about the feed (table).
    links
        Include the flexible link sections of a planar robot's file; a robot in space always includes its links.
    band : Hz
        Lowest and highest frequency of the FRF.
    lines
        Number of frequency lines of the FRF.
    sensor_at : m
        Place of a housing sensor from the tip, in the axes of the tip: the model (.json) holds its motion too.
    learned
        File that `robot learn` wrote: the prediction from measured postures, with its band.
    picture
        Picture of the receptance to write.
    table
        Table of the receptance to write.

    Returns
    -------
    ModalModel
        Modal model at the tool tip; its method ``frf`` gives the receptance.

    Raises
    ------
    InputError
        A posture that the robot does not reach, a file without masses, or options that exclude each other.

    Examples
    --------
    ::

        $ millfrf robot frf kuka_kr90_r3100 --at 2.0 0 0.8 --out tip.json
    """
    if learned is not None and (sensor_at is not None or links or picture is not None or table is not None):
        raise InputError("--learned excludes --sensor-at, --links, --picture and --table; leave them out")
    suffix = "" if out is None else Path(out).suffix.lower()
    if suffix == ".csv" and learned is None:
        raise InputError(f"cannot write {out}: .csv is the band of --learned; change the suffix of --out")
    if sensor_at is not None and suffix not in ("", ".json"):
        raise InputError(f"cannot write {out}: --sensor-at is for a modal model; change the suffix of --out to .json")
    case = read_robot(robot)
    driven, axes = posture_of(case, pose, joints, cut_place(at, feed, turn, redundancy))
    posture, frequencies = shown_values(mechanism_of(case), driven), np.linspace(*band, lines)
    if learned is not None:
        return _predicted(robot, spatial(case), learned, (driven, axes), posture, frequencies, out)
    result = in_posture(case, driven, axes, links=links)
    tip = model = result.known_model()
    if sensor_at is not None:
        model = cell_structure_at(spatial(case).robot, driven, np.array(sensor_at), axes=axes)
    if out is not None:
        stated = _stated(robot, posture, result.warnings, origin("robot frf", [robot]))
        if suffix == ".json":
            _write_model(Path(out), model, stated)
        else:
            frf = with_errors(model.frf(frequencies), case, driven, axes)
            write_frf(Path(out), frf, provenance=json.dumps(stated))
    if picture is not None:
        save_figure(receptance_figure(tip.frf(frequencies), result.frequencies), picture)
        say_written([picture])
    if table is not None:
        made_of = origin("robot frf", [robot], {"posture": posture})
        write_receptance_table(Path(table), tip.frf(frequencies), result.warnings, made_of)
        say_written([table])
    warn(result.warnings)
    tell(lambda: {"posture": posture, **model_answer(model)})
    say_written([out], f"{len(model.poles)} modes from {model.natural_frequencies.min():.2f} Hz")
    return model


def _stated(robot: File, posture: str, warnings: Sequence[str], made_of: dict[str, Any]) -> dict[str, Any]:
    """Return the provenance of a receptance."""
    return {"command": "robot frf", "robot": str(robot), "posture": posture, "warnings": list(warnings), **made_of}


def _write_model(path: Path, model: ModalModel, stated: dict[str, Any]) -> None:
    with writing_whole_file(path) as unfinished:
        write_modal_model(unfinished, model)
        add_to_json(unfinished, stated)


def _predicted(
    robot: File,
    case: SpatialCase,
    learned: File,
    posture: tuple[Real, Real | None],
    name: str,
    frequencies: Real,
    out: File | None,
) -> ModalModel:
    """Write a prediction from learned postures: modal model with covariance (.json), mean FRF (.h5) or band (.csv)."""
    predicted = predicted_posture(case, learned, *posture)
    model = predicted.model
    if out is not None:
        path = Path(out)
        made_of = origin("robot frf", [robot, learned], {"learned": Path(learned).name})
        stated = _stated(robot, name, predicted.warnings, made_of)
        if path.suffix.lower() == ".json":
            _write_model(path, model, stated)
        elif path.suffix.lower() == ".h5":
            write_frf(path, model.frf(frequencies), provenance=json.dumps(stated))
        else:
            write_receptance_band(path, frequencies, predicted, stated)
    tell(lambda: {"posture": name, **model_answer(model)})
    show(table_of_modes(predicted, name))
    warn(predicted.warnings, 5)
    if out is not None:
        say_written([out], f"{len(model.poles)} modes, {STORED[Path(out).suffix.lower()]}")
    return model
