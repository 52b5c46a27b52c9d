"""The jobs `robot_diagnose` and `learn`: what is wrong with the robot's model, and what it learns from all poses."""

from collections import Counter
from pathlib import Path
from typing import Any

from millfrf.core import InputError
from millfrf.mismatch import LabError

from ...robot import Asking, LearningFrom, diagnose_robot_files, learn_from_files
from .fit import MODEL
from .sound_recordings import sound_files
from .work import Work

LEARNED = "learned.json"


def robot_diagnose(work: Work, folder: Path) -> list[str]:
    """Diagnosis of the robot's model, an improved model for each recording, and a report.

    Raises
    ------
    InputError
        Robot and recordings cannot be compared, or no recording is left.
    """
    asked, given = work.settings, len(work.files) - len(work.settings["poses"])
    poses = {path.stem: pose for path, pose in zip(work.files[given:], asked["poses"], strict=True)}
    recordings, lines = sound_files(work, given)
    asking = Asking(
        tuple(poses[path.stem] for path in recordings),
        asked["feed_deg"],
        _tuple(asked["band_hz"]),
        _tuple(asked["sensor_m"]),
        _tuple(asked["payload_at_m"]),
        asked["rigid_links"],
        LabError(*asked["model_error"]),
        asked["stream"],
    )
    told = diagnose_robot_files(_robot(work), recordings, folder, asking, dated=False)
    return [*lines, *(line.removeprefix("warning: ") for line in told if line.startswith("warning: "))]


def learn(work: Work, folder: Path) -> list[str]:
    """Learned postures from the models of all sets.

    Raises
    ------
    InputError
        No set has a model, or the models do not fit the robot.
    """
    asked = work.settings
    named = list(zip(work.needs, asked["names"], asked["poses"], strict=True))
    left = [(one.folder / MODEL, name, pose) for one, name, pose in named if one.done]
    if not left:
        raise InputError("no set has a modal model")
    taken = _first_of_each_pose(left, asked["sets_per_pose"])
    models, names, poses = zip(*taken, strict=True)
    learn_from_files(_robot(work), models, LearningFrom(poses, asked["feed_deg"]), folder / LEARNED, names)
    beside = [f"{len(left) - len(taken)} further sets of the same poses: see sets_per_pose"] * (len(left) > len(taken))
    return [*(f"left out {name}: {one.reason}" for one, name, _ in named if not one.done), *beside]


def _first_of_each_pose(left: list[tuple[Path, str, str]], most: int) -> list[tuple[Path, str, str]]:
    """Models with name and posture, of each posture the first ``most``: more say little of other postures."""
    counts: Counter[str] = Counter()
    taken = []
    for one in left:
        if counts[one[2]] < most:
            taken.append(one)
        counts[one[2]] += 1
    return taken


def _robot(work: Work) -> str:
    """Name of a robot that ships, or the path of its file."""
    named = work.settings["robot"]
    return str(work.files[0]) if named is None else str(named)


def _tuple(value: Any) -> Any:
    return None if value is None else tuple(value)
