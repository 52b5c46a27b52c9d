"""From a campaign file and its recordings to tasks."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from estimation import count_segments, settings_for
from millfrf.core import InputError
from millfrf.core.steps import completed
from millfrf.steps.estimate import LOCAL, EstimateOptions, estimate
from millfrf.steps.fit import POLYREFERENCE, SUBSPACE

from .campaign_tables import CampaignFile, EstimateTable
from .labels import filled_in, labels_in
from .recordings import FoundRecording
from .tasks import Plan, RecordingSet, Task, all_together, grouped, in_order

FAN_IN = 8
"""Spectra that one task adds up."""


def options_of(table: EstimateTable) -> EstimateOptions:
    """The options of ``millfrf estimate`` that the table states."""
    return EstimateOptions(**completed(estimate, table.options))


def estimate_tasks(one: RecordingSet, table: EstimateTable) -> Iterator[Task]:
    """All tasks of one set, from spectra to the FRF."""
    options = options_of(table)
    settings: dict[str, Any] = {"options": asdict(options)}
    checks = tuple(f"check:{recording.name}" for recording in one.recordings)
    files = tuple(str(recording.path) for recording in one.recordings)
    if options.estimator == LOCAL:
        yield Task("estimate", one.name, files, checks, settings)
        return
    tests = []
    for recording in one.recordings:
        tasks = _of_recording(recording, table, settings)
        yield from tasks
        tests.append(tasks[-1].identity)
    if options.stack == "sum":
        for task in _sums(one.name, tests, settings):
            yield task
            tests = [name for name in tests if name not in task.needs] + [task.identity]
    yield Task("estimate", one.name, (), (*checks, *tests), settings)


def _of_recording(recording: FoundRecording, table: EstimateTable, settings: dict[str, Any]) -> list[Task]:
    """Spectra of one recording; where it is long, of its parts, and these joined."""
    check, path = (f"check:{recording.name}",), (str(recording.path),)
    parts = parts_of(recording, table)
    if len(parts) == 1:
        return [Task("spectra", recording.name, path, check, {**settings, "segments": None})]
    tasks = [
        Task("spectra", f"{recording.name} part {number}", path, check, {**settings, "segments": list(part)})
        for number, part in enumerate(parts, 1)
    ]
    return [*tasks, Task("join", recording.name, path, tuple(task.identity for task in tasks), settings)]


def parts_of(recording: FoundRecording, table: EstimateTable) -> list[tuple[int, int]]:
    """First segment of each part and the one after its last; one part where the recording is short.

    Recordings from which segments may be left out stay whole, since a part might have none left.
    """
    streams = {name: (n_samples, rate) for name, n_samples, rate in recording.look.streams}
    options = options_of(table)
    name = options.stream if options.stream is not None else next(iter(streams), "")
    n_samples, rate = streams.get(name, (0, 1.0))
    if options.exclude or n_samples <= table.part_s * rate:
        return [(0, 0)]
    settings = settings_for(rate, options.segment, overlap=options.overlap, window=options.window)
    count = count_segments(n_samples, settings)
    parts = max(1, min(count, round(n_samples / (table.part_s * rate))))
    edges = [count * number // parts for number in range(parts + 1)]
    return list(pairwise(edges))


def _sums(name: str, tests: Sequence[str], settings: dict[str, Any]) -> Iterator[Task]:
    """A tree of sums with so many branches that at most :data:`FAN_IN` spectra are left."""
    level, number = list(tests), 0
    while len(level) > FAN_IN:
        made = []
        for first in range(0, len(level), FAN_IN):
            number += 1
            task = Task("sum", f"{name} {number}", (), tuple(level[first : first + FAN_IN]), settings)
            made.append(task.identity)
            yield task
        level = made


def check_task(recording: FoundRecording, asked: dict[str, Any]) -> Task:
    """The task that judges one recording by itself."""
    return Task("check", recording.name, (str(recording.path),), (), {**asked, "fault": recording.fault})


ALL = "all"
"""Name of what is done once, with all sets."""

PoseOf = Callable[[RecordingSet | FoundRecording], str | None]


@dataclass(frozen=True)
class _Planner:
    """What planning looks at: the file, its folder, the robot, and the posture of a set in words."""

    file: CampaignFile
    base: Path
    robot: str | None
    pose_of: PoseOf

    def named(self, template: str, labels: dict[str, Any]) -> str:
        return str(self.base / filled_in(template, labels))

    @property
    def robot_files(self) -> tuple[str, ...]:
        return (self.robot,) if self.robot is not None and Path(self.robot).is_file() else ()


def plan_campaign(
    file: CampaignFile, base: Path, recordings: Sequence[FoundRecording], robot: str | None, pose_of: PoseOf
) -> Plan:
    """Plan all tasks but the report, which is made of what the others leave.

    Parameters
    ----------
    file
        Campaign as its file states it.
    base
        Folder of its file.
    recordings
        Recordings of the campaign, labelled.
    robot
        Name of a robot that ships, or the path of its file; None: none is stated.
    pose_of
        Function that gives the posture of a set or a recording as commands take it, or None.

    Raises
    ------
    InputError
        Options that contradict each other, labels that nothing has, a file that is not there, or two tasks of one name.
    """
    planner = _Planner(file, base, robot, pose_of)
    _check_asked(planner)
    sets, lacking = grouped(recordings, file.sets.by)
    left_out = [_lacking(one, file.sets.by) for one in lacking if not one.fault]  # of faults the check tells
    asked = _checked_as(file)
    tasks = [check_task(one, asked) for one in lacking]
    last: dict[str, dict[str, str]] = {}
    for one in sets:
        last[one.name] = {}
        tasks += [check_task(recording, asked) for recording in one.recordings]
        for task, result in _of_set(planner, one):
            tasks.append(task)
            if result:
                last[one.name][result] = task.identity
    tasks += _diagnoses(planner, recordings, sets, last)
    tasks += _robot_diagnoses(planner, recordings, left_out)
    tasks += _learning(planner, sets, last, left_out)
    return Plan(in_order(tasks), tuple(sets), last, tuple(left_out))


def _check_asked(planner: _Planner) -> None:
    """Refuse options and names of files before anything is planned."""
    file = planner.file
    if file.estimate is not None:
        options_of(file.estimate).check()
    named = [
        *([] if file.calibrate is None else [file.calibrate.options[name] for name in ("tip", "sensor")]),
        *([] if file.lobes is None else [file.lobes.options["cutting"]]),
        *([] if file.diagnose is None else [file.diagnose.options[name] for name in ("model", "cutting")]),
    ]
    for template in named:
        if template is not None and not labels_in(template) and not (planner.base / template).is_file():
            raise InputError(f"no file {template} in {planner.base}; check the name in the campaign's file")


def _lacking(one: FoundRecording, by: Sequence[str]) -> str:
    missing = [label for label in by if label not in one.labels.values]
    return f"{one.path.name} belongs to no set: it has no label {missing[0]}"


def _checked_as(file: CampaignFile) -> dict[str, Any]:
    """Channels and segments for which each recording is judged by itself."""
    if file.estimate is not None:
        options = options_of(file.estimate)
        return {"options": asdict(options), "segments": options.estimator != LOCAL}
    table = file.fit or file.diagnose or file.robot_diagnose
    stated = {} if table is None else table.options
    chosen: dict[str, Any] = {name: stated[name] for name in ("stream", "excitations", "responses") if name in stated}
    return {"options": completed(estimate, chosen), "segments": False}


def _of_set(planner: _Planner, one: RecordingSet) -> Iterator[tuple[Task, str]]:
    """Tasks of one set with what the report reads of each."""
    file = planner.file
    if file.estimate is not None:
        for task in estimate_tasks(one, file.estimate):
            yield task, "frf" if task.kind == "estimate" else ""
    if file.fit is None:
        return
    model = _fit(planner, one)
    yield model, "" if file.calibrate else "model"
    if file.calibrate is not None:
        taps = tuple(
            _or_template(planner, name, one)
            for name in (file.calibrate.options["tip"], file.calibrate.options["sensor"])
        )
        model = Task("calibrate", one.name, taps, (model.identity,))
        yield model, "model"
    if file.lobes is not None:
        asked = dict(file.lobes.options)
        cutting = _or_template(planner, asked.pop("cutting"), one)
        yield Task("lobes", one.name, (cutting,), (model.identity,), {"options": asked}), "lobes"


def _or_template(planner: _Planner, template: str, one: RecordingSet) -> str:
    """The file for this set; where a label is missing the name with its braces, which the task then refuses."""
    try:
        return planner.named(template, one.labels)
    except InputError:
        return str(planner.base / template)


def _fit(planner: _Planner, one: RecordingSet) -> Task:
    table = planner.file.fit
    assert table is not None
    method = table.options["method"] or (SUBSPACE if planner.file.estimate is None else POLYREFERENCE)
    settings = {"options": {**table.options, "method": method}}
    if method == POLYREFERENCE:
        return Task("fit", one.name, (), (f"estimate:{one.name}",), settings)
    files, checks = _files_and_checks(one.recordings)
    return Task("fit", one.name, files, checks, settings)


def _files_and_checks(recordings: Sequence[FoundRecording]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(str(one.path) for one in recordings), tuple(f"check:{one.name}" for one in recordings)


def _diagnoses(
    planner: _Planner,
    recordings: Sequence[FoundRecording],
    sets: Sequence[RecordingSet],
    last: dict[str, dict[str, str]],
) -> Iterator[Task]:
    """Diagnoses of recordings that belong together; each set is told which is its own."""
    table = planner.file.diagnose
    if table is None:
        return
    by = planner.file.sets.by if table.by is None else table.by
    groups = grouped(recordings, by)[0] if by or table.by is None else [all_together(recordings, ALL)]
    for group in groups:
        files, checks = _files_and_checks(group.recordings)
        options = dict(table.options)
        model, cutting = options.pop("model"), options.pop("cutting")
        inputs = [_or_template(planner, name, group) for name in (model, cutting) if name is not None]
        settings = {"options": options, "cutting": cutting is not None}
        task = Task("diagnose", group.name, (*inputs, *files), checks, settings)
        yield task
        members = {one.name for one in group.recordings}
        for one in sets:
            if members.issuperset(recording.name for recording in one.recordings):
                last[one.name]["diagnosis"] = task.identity


def _robot_diagnoses(planner: _Planner, recordings: Sequence[FoundRecording], left_out: list[str]) -> Iterator[Task]:
    table = planner.file.robot_diagnose
    if table is None:
        return
    posed = [one for one in recordings if planner.pose_of(one) is not None]
    left_out += [
        f"{one.path.name} is left out of the robot's diagnosis: its posture is not known"
        for one in recordings
        if planner.pose_of(one) is None and not one.fault
    ]
    for group in grouped(posed, table.by)[0] if table.by else [all_together(posed, ALL)] if posed else []:
        files, checks = _files_and_checks(group.recordings)
        settings = {
            "options": table.options,
            "robot": _robot_name(planner),
            "poses": [planner.pose_of(one) for one in group.recordings],
        }
        yield Task("robot_diagnose", group.name, (*planner.robot_files, *files), checks, settings)


def _learning(
    planner: _Planner, sets: Sequence[RecordingSet], last: dict[str, dict[str, str]], left_out: list[str]
) -> Iterator[Task]:
    table = planner.file.learn
    if table is None:
        return
    posed = [one for one in sets if planner.pose_of(one) is not None]
    left_out += [
        f"set {one.name} is left out of the posture model: its posture is not known, or stated in two ways"
        for one in sets
        if one not in posed
    ]
    settings = {
        "options": table.options,
        "sets_per_pose": table.sets_per_pose,
        "robot": _robot_name(planner),
        "names": [one.name for one in posed],
        "poses": [planner.pose_of(one) for one in posed],
    }
    needs = tuple(last[one.name]["model"] for one in posed)
    yield Task("learn", ALL, planner.robot_files, needs, settings)


def _robot_name(planner: _Planner) -> str | None:
    """The robot's name in settings: a file's content counts, not where it lies."""
    return None if planner.robot_files else planner.robot
