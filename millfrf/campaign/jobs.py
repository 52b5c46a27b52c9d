"""Jobs of a campaign: each does what a command does, and writes into a folder."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from estimation import check_equal_rates
from millfrf.core import InputError
from millfrf.core.provenance import origin
from millfrf.core.terminal import silently
from millfrf.gate import join_judged, read_checked_cutting
from millfrf.robot_model import read_robot
from millfrf.steps.calibrate import calibrate as calibrate_to_tip
from millfrf.steps.diagnose import diagnose as diagnose_model
from millfrf.steps.diagnose import write_diagnosis_folder
from millfrf.steps.estimate import LOCAL, EstimateOptions, estimate_of_spectra, write_estimate
from millfrf.steps.estimate import estimate as estimate_frf
from millfrf.steps.fit import POLYREFERENCE
from millfrf.steps.fit import fit as fit_model
from millfrf.steps.lobes import lobes as lobes_of
from millfrf.steps.robot.diagnose import diagnose_robot, write_robot_diagnosis
from millfrf.steps.robot.learn import learn_postures
from millfrf.steps.robot.postures import spatial

from .results.sets import MeasuredSet
from .results.summary import write_summary
from .work import (
    Outcome,
    Work,
    add,
    as_options,
    check,
    join,
    lines_on_refused,
    read_judged,
    read_spectra,
    sound_checks,
    sound_files,
    spectra,
)

FRF = "frf.h5"


def estimate(work: Work, folder: Path) -> list[str]:
    """FRF over the recordings of a set that are left.

    Raises
    ------
    InputError
        None is left, or the gate refuses them together.
    """
    options = EstimateOptions(**as_options(work.settings["options"]))
    if options.estimator == LOCAL:
        paths, lines = sound_files(work)
        with silently():
            found = estimate_frf(*paths, out=folder / FRF, **asdict(options))
        return [*lines, *found.warnings]
    checks, lines = sound_checks(work)
    tests = [one for one in work.needs if one.kind != "check"]
    left = [read_spectra(one.folder) for one in tests if one.done]
    if not left:
        raise InputError("; ".join(dict.fromkeys(one.reason for one in tests)))
    gains = [gain for _, gains in left for gain in gains]
    summed = {gain.name for gain in gains}
    judged = [found for found in map(read_judged, checks) if found[0].file in summed]
    _refuse_copies([(one.file, beside["sha256"]) for one, beside in judged])
    check_equal_rates([one.file for one, _ in judged], [beside["sample_rate"] for _, beside in judged])
    doubts = join_judged([one for one, _ in judged])
    doubts = [*lines, *lines_on_refused(tests), *doubts]
    made = estimate_of_spectra([found for found, _ in left], gains, doubts, options)
    stated = [{"file": one.file, "sha256": beside["sha256"]} for one, beside in judged]
    write_estimate(folder / FRF, made, stated)
    return list(made.warnings)


def _refuse_copies(files: list[tuple[str, str]]) -> None:
    seen: dict[str, str] = {}
    for name, digest in files:
        if seen.setdefault(digest, name) != name:
            raise InputError(f"{name} is the same recording as {seen[digest]}; give each test once")


MODEL = "model.json"


def fit(work: Work, folder: Path) -> list[str]:
    """Modal model of a set, of its FRF or straight from its recordings.

    Raises
    ------
    InputError
        What is left of the set cannot be fitted.
    MillfrfError
        No stable pole was found.
    """
    options = as_options(work.settings["options"])
    of_frf = options["method"] == POLYREFERENCE
    paths, lines = ([work.need("estimate").folder / FRF], []) if of_frf else sound_files(work)
    with silently():
        found = fit_model(*paths, out=folder / MODEL, **options)
    return [*lines, *found.warnings]


def calibrate(work: Work, folder: Path) -> list[str]:
    """Carry the model of a set to the tool tip by two hammer FRFs.

    Raises
    ------
    InputError
        There is no model, or the three do not match.
    """
    tip, sensor = work.files
    model = work.need("fit").folder / MODEL
    with silently():
        return list(calibrate_to_tip(model, tip=tip, sensor=sensor, out=folder / MODEL).warnings)


DIAGNOSIS = "diagnosis.json"


def diagnose(work: Work, folder: Path) -> list[str]:
    """Diagnosis, improved model and report.

    Raises
    ------
    InputError
        Model and recordings cannot be compared, or no recording is left.
    """
    with_cut = bool(work.settings["cutting"])
    recordings, lines = sound_files(work, 2 if with_cut else 1)
    process, doubts = read_checked_cutting(work.files[1]) if with_cut else (None, [])
    options = as_options(work.settings["options"])
    model = work.files[0]
    with silently():
        made = diagnose_model(model, *recordings, **options)
    origin_of = origin("diagnose", [model, *recordings], options)
    write_diagnosis_folder(folder, made, model.name, origin_of, process, dated=False)
    return [*lines, *doubts, *made.doubts]


LOBES = "lobes.csv"


def lobes(work: Work, folder: Path) -> list[str]:
    """Stability lobes of the model at the tool tip.

    Raises
    ------
    InputError
        There is no model, or the cut and the model do not fit together.
    """
    (cutting,) = work.files
    model = work.need(work.needs[0].kind).folder / MODEL
    with silently():
        found = lobes_of(model, cutting=cutting, out=folder / LOBES, **as_options(work.settings["options"]))
    return list(found.warnings)


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
    options, robot = as_options(asked["options"]), _robot(work)
    options["poses"] = [poses[path.stem] for path in recordings]
    with silently():
        found = diagnose_robot(robot, *recordings, **options)
    origin_of = origin("robot diagnose", [robot, *recordings], options)
    write_robot_diagnosis(folder, found, spatial(read_robot(robot)).name, origin_of, dated=False)
    return [*lines, *found.doubts]


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
    with silently():
        learn_postures(
            _robot(work), *models, poses=poses, names=names, out=folder / LEARNED, **as_options(asked["options"])
        )
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


FILE_OF = {"model": MODEL, "lobes": LOBES, "diagnosis": DIAGNOSIS}
"""File of each result that the report reads."""


def report(work: Work, folder: Path) -> list[str]:
    """Summary of the campaign.

    Raises
    ------
    InputError
        A library that it needs is missing.
    """
    asked = work.settings
    outcomes = {one.identity: one for one in work.needs}
    learned = outcomes.get(asked["learned"])
    write_summary(
        folder,
        asked["title"],
        [_measured(one, outcomes) for one in asked["sets"]],
        robot=str(work.files[0]) if work.files else asked["robot"],
        learned=learned.folder / LEARNED if learned is not None and learned.done else None,
        failures=asked["failures"],
    )
    return []


def _measured(stored: dict[str, Any], outcomes: dict[str, Outcome]) -> MeasuredSet:
    """A set as it stands in the settings, with the files of its results."""
    found = {
        result: outcomes[identity].folder / FILE_OF[result]
        for result, identity in stored["results"].items()
        if result in FILE_OF and identity in outcomes and outcomes[identity].done
    }
    posture = stored["posture"]
    return MeasuredSet(
        stored["name"],
        stored["labels"],
        None if posture is None else tuple(posture),
        stored["recorded_at"],
        tuple(stored["recordings"]),
        found.get("model"),
        found.get("lobes"),
        found.get("diagnosis"),
        tuple(stored["failures"]),
    )


JOB_OF: dict[str, Callable[[Work, Path], list[str]]] = {
    "check": check,
    "spectra": spectra,
    "join": join,
    "sum": add,
    "estimate": estimate,
    "fit": fit,
    "calibrate": calibrate,
    "lobes": lobes,
    "diagnose": diagnose,
    "robot_diagnose": robot_diagnose,
    "learn": learn,
    "report": report,
}
"""A job writes its files into a folder that is there, and returns doubts; what it refuses it raises."""
