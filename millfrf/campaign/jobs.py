"""Jobs of a campaign: each does the work of one command and writes its files into a folder."""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from estimation import check_equal_rates
from millfrf.core import InputError
from millfrf.core.provenance import origin
from millfrf.core.terminal import silently
from millfrf.gate import join_checks, read_checked_cutting, recorded_cuts
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
    """Estimate the FRF over the usable recordings of a set."""
    options = EstimateOptions(**as_options(work.settings["options"]))
    if options.estimator == LOCAL:
        paths, lines = sound_files(work)
        with silently():
            pair = estimate_frf(*paths, out=folder / FRF, **asdict(options))
        return [*lines, *pair.warnings]
    checks, lines = sound_checks(work)
    tests = [outcome for outcome in work.needs if outcome.kind != "check"]
    usable = [read_spectra(outcome.folder) for outcome in tests if outcome.done]
    if not usable:
        raise InputError("; ".join(dict.fromkeys(outcome.reason for outcome in tests)))
    gains = [gain for _, gains in usable for gain in gains]
    summed = {gain.name for gain in gains}
    judged = [pair for pair in map(read_judged, checks) if pair[0].file in summed]
    _refuse_copies([(outcome.file, extra["sha256"]) for outcome, extra in judged])
    check_equal_rates([outcome.file for outcome, _ in judged], [extra["sample_rate"] for _, extra in judged])
    doubts = join_checks([outcome for outcome, _ in judged])
    doubts = [*lines, *lines_on_refused(tests), *doubts]
    frf = estimate_of_spectra([pair for pair, _ in usable], gains, doubts, options)
    sources = [{"file": outcome.file, "sha256": extra["sha256"]} for outcome, extra in judged]
    write_estimate(folder / FRF, frf, sources, recorded_cuts(sound_files(work)[0]))
    return list(frf.warnings)


def _refuse_copies(files: list[tuple[str, str]]) -> None:
    seen: dict[str, str] = {}
    for name, digest in files:
        if seen.setdefault(digest, name) != name:
            raise InputError(f"{name} is the same recording as {seen[digest]}; give each test once")


MODEL = "model.json"


def fit(work: Work, folder: Path) -> list[str]:
    """Fit a modal model to the FRF or to the recordings of a set."""
    options = as_options(work.settings["options"])
    of_frf = options["method"] == POLYREFERENCE
    paths, lines = ([work.need("estimate").folder / FRF], []) if of_frf else sound_files(work)
    with silently():
        model = fit_model(*paths, out=folder / MODEL, **options)
    return [*lines, *model.warnings]


def calibrate(work: Work, folder: Path) -> list[str]:
    """Transfer the model of a set to the tool tip with two hammer FRFs."""
    tip, sensor = work.files
    model = work.need("fit").folder / MODEL
    with silently():
        return list(calibrate_to_tip(model, tip=tip, sensor=sensor, out=folder / MODEL).warnings)


DIAGNOSIS = "diagnosis.json"


def diagnose(work: Work, folder: Path) -> list[str]:
    """Write a diagnosis, an improved model and a report."""
    with_cut = bool(work.settings["cutting"])
    recordings, lines = sound_files(work, 2 if with_cut else 1)
    process, doubts = read_checked_cutting(work.files[1]) if with_cut else (None, [])
    options = as_options(work.settings["options"])
    model = work.files[0]
    with silently():
        diagnosis = diagnose_model(model, *recordings, **options)
    origin_of = origin("diagnose", [model, *recordings], options)
    write_diagnosis_folder(folder, diagnosis, model.name, origin_of, process, dated=False)
    return [*lines, *doubts, *diagnosis.doubts]


LOBES = "lobes.csv"


def lobes(work: Work, folder: Path) -> list[str]:
    """Compute the stability lobes of the model at the tool tip."""
    (cutting,) = work.files
    model = work.need(work.needs[0].kind).folder / MODEL
    with silently():
        limits = lobes_of(model, cutting=cutting, out=folder / LOBES, **as_options(work.settings["options"]))
    return list(limits.warnings)


LEARNED = "learned.json"


def robot_diagnose(work: Work, folder: Path) -> list[str]:
    """Write a diagnosis of the robot model, an improved model for each recording, and a report."""
    settings, n_inputs = work.settings, len(work.files) - len(work.settings["poses"])
    poses = {path.stem: pose for path, pose in zip(work.files[n_inputs:], settings["poses"], strict=True)}
    recordings, lines = sound_files(work, n_inputs)
    options, robot = as_options(settings["options"]), _robot(work)
    options["poses"] = [poses[path.stem] for path in recordings]
    with silently():
        diagnosis = diagnose_robot(robot, *recordings, **options)
    origin_of = origin("robot diagnose", [robot, *recordings], options)
    write_robot_diagnosis(folder, diagnosis, spatial(read_robot(robot)).name, origin_of, dated=False)
    return [*lines, *diagnosis.doubts]


def learn(work: Work, folder: Path) -> list[str]:
    """Learn the dynamics over postures from the models of all sets."""
    settings = work.settings
    sets = list(zip(work.needs, settings["names"], settings["poses"], strict=True))
    usable = [(outcome.folder / MODEL, name, pose) for outcome, name, pose in sets if outcome.done]
    if not usable:
        raise InputError("no set has a modal model")
    used = _first_of_each_pose(usable, settings["sets_per_pose"])
    models, names, poses = zip(*used, strict=True)
    with silently():
        learn_postures(
            _robot(work), *models, poses=poses, names=names, out=folder / LEARNED, **as_options(settings["options"])
        )
    unused = [f"{len(usable) - len(used)} further sets of the same poses: see sets_per_pose"] * (
        len(usable) > len(used)
    )
    return [*(f"left out {name}: {outcome.reason}" for outcome, name, _ in sets if not outcome.done), *unused]


def _first_of_each_pose(usable: list[tuple[Path, str, str]], limit: int) -> list[tuple[Path, str, str]]:
    """Return the first ``limit`` models of each posture: repeats cost time and add little information."""
    counts: Counter[str] = Counter()
    chosen = []
    for model in usable:
        if counts[model[2]] < limit:
            chosen.append(model)
        counts[model[2]] += 1
    return chosen


def _robot(work: Work) -> str:
    """Return the name of a built-in robot, or the path of a robot file."""
    name = work.settings["robot"]
    return str(work.files[0]) if name is None else str(name)


FILE_OF = {"model": MODEL, "lobes": LOBES, "diagnosis": DIAGNOSIS}  # files that the report reads


def report(work: Work, folder: Path) -> list[str]:
    """Write the report of the campaign."""
    settings = work.settings
    outcomes = {item.identity: item for item in work.needs}
    learned = outcomes.get(settings["learned"])
    write_summary(
        folder,
        settings["title"],
        [_measured(item, outcomes) for item in settings["sets"]],
        robot=str(work.files[0]) if work.files else settings["robot"],
        learned=learned.folder / LEARNED if learned is not None and learned.done else None,
        failures=settings["failures"],
    )
    return []


def _measured(stored: dict[str, Any], outcomes: dict[str, Outcome]) -> MeasuredSet:
    """Combine a set of the settings with the files of its results."""
    files = {
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
        files.get("model"),
        files.get("lobes"),
        files.get("diagnosis"),
        tuple(stored["failures"]),
    )


# a job writes into an existing folder and returns warnings; an InputError refuses the task
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
