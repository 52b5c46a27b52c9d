"""Plan the tasks of a campaign file and its recordings."""

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

FAN_IN = 8  # spectra that one task adds up


def options_of(table: EstimateTable) -> EstimateOptions:
    """Return the options of ``millfrf estimate`` in the table, with defaults."""
    return EstimateOptions(**completed(estimate, table.options))


def estimate_tasks(recording_set: RecordingSet, table: EstimateTable) -> Iterator[Task]:
    """Yield all tasks of one set from spectra to the FRF."""
    options = options_of(table)
    settings: dict[str, Any] = {"options": asdict(options)}
    checks = tuple(f"check:{recording.name}" for recording in recording_set.recordings)
    files = tuple(str(recording.path) for recording in recording_set.recordings)
    if options.estimator == LOCAL:
        yield Task("estimate", recording_set.name, files, checks, settings)
        return
    tests = []
    for recording in recording_set.recordings:
        tasks = _of_recording(recording, table, settings)
        yield from tasks
        tests.append(tasks[-1].identity)
    if options.stack == "sum":
        for task in _sums(recording_set.name, tests, settings):
            yield task
            tests = [name for name in tests if name not in task.needs] + [task.identity]
    yield Task("estimate", recording_set.name, (), (*checks, *tests), settings)


def _of_recording(recording: FoundRecording, table: EstimateTable, settings: dict[str, Any]) -> list[Task]:
    """Return the tasks for the spectra of one recording; split a long recording into parts and join their spectra."""
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
    """Split a recording into parts, and return the range of segments (first, last + 1) of each part.

    A short recording has one part. A recording from which segments may be excluded is not split, because all segments
    of a part might be excluded.
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
    """Yield tasks that add up at most :data:`FAN_IN` spectra each, until at most :data:`FAN_IN` spectra are left."""
    level, number = list(tests), 0
    while len(level) > FAN_IN:
        sums = []
        for first in range(0, len(level), FAN_IN):
            number += 1
            task = Task("sum", f"{name} {number}", (), tuple(level[first : first + FAN_IN]), settings)
            sums.append(task.identity)
            yield task
        level = sums


def check_task(recording: FoundRecording, settings: dict[str, Any]) -> Task:
    return Task("check", recording.name, (str(recording.path),), (), {**settings, "fault": recording.fault})


ALL = "all"  # name of tasks over all sets

PoseOf = Callable[[RecordingSet | FoundRecording], str | None]


@dataclass(frozen=True)
class _Planner:
    """Inputs of the plan."""

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
    """Plan all tasks except the report, which depends on the outcomes of all tasks."""
    planner = _Planner(file, base, robot, pose_of)
    _check_options(planner)
    sets, lacking = grouped(recordings, file.sets.by)
    left_out = [_lacking(item, file.sets.by) for item in lacking if not item.fault]  # the check reports the fault
    settings = _check_settings(file)
    tasks = [check_task(item, settings) for item in lacking]
    last: dict[str, dict[str, str]] = {}
    for item in sets:
        last[item.name] = {}
        tasks += [check_task(recording, settings) for recording in item.recordings]
        for task, result in _of_set(planner, item):
            tasks.append(task)
            if result:
                last[item.name][result] = task.identity
    tasks += _diagnoses(planner, recordings, sets, last)
    tasks += _robot_diagnoses(planner, recordings, left_out)
    tasks += _learning(planner, sets, last, left_out)
    return Plan(in_order(tasks), tuple(sets), last, tuple(left_out))


def _check_options(planner: _Planner) -> None:
    """Check options and names of files before planning."""
    file = planner.file
    if file.estimate is not None:
        options_of(file.estimate).check()
    templates = [
        *([] if file.calibrate is None else [file.calibrate.options[name] for name in ("tip", "sensor")]),
        *([] if file.lobes is None else [file.lobes.options["cutting"]]),
        *([] if file.diagnose is None else [file.diagnose.options[name] for name in ("model", "cutting")]),
    ]
    for template in templates:
        if template is not None and not labels_in(template) and not (planner.base / template).is_file():
            raise InputError(f"no file {template} in {planner.base}; check the name in the campaign's file")


def _lacking(recording: FoundRecording, by: Sequence[str]) -> str:
    missing = [label for label in by if label not in recording.labels.values]
    return f"{recording.path.name} belongs to no set: it has no label {missing[0]}"


def _check_settings(file: CampaignFile) -> dict[str, Any]:
    """Return the channels and segments for which each recording is checked."""
    if file.estimate is not None:
        options = options_of(file.estimate)
        return {"options": asdict(options), "segments": options.estimator != LOCAL}
    table = file.fit or file.diagnose or file.robot_diagnose
    options_of_table = {} if table is None else table.options
    chosen: dict[str, Any] = {
        name: options_of_table[name] for name in ("stream", "excitations", "responses") if name in options_of_table
    }
    return {"options": completed(estimate, chosen), "segments": False}


def _of_set(planner: _Planner, recording_set: RecordingSet) -> Iterator[tuple[Task, str]]:
    """Yield the tasks of one set, each with the name of its result in the report (empty: none)."""
    file = planner.file
    if file.estimate is not None:
        for task in estimate_tasks(recording_set, file.estimate):
            yield task, "frf" if task.kind == "estimate" else ""
    if file.fit is None:
        return
    model = _fit(planner, recording_set)
    yield model, "" if file.calibrate else "model"
    if file.calibrate is not None:
        taps = tuple(
            _or_template(planner, name, recording_set)
            for name in (file.calibrate.options["tip"], file.calibrate.options["sensor"])
        )
        model = Task("calibrate", recording_set.name, taps, (model.identity,))
        yield model, "model"
    if file.lobes is not None:
        options = dict(file.lobes.options)
        cutting = _or_template(planner, options.pop("cutting"), recording_set)
        yield Task("lobes", recording_set.name, (cutting,), (model.identity,), {"options": options}), "lobes"


def _or_template(planner: _Planner, template: str, recording_set: RecordingSet) -> str:
    """Fill the labels of a set into a file name.

    If the set lacks one of the labels, return the name unchanged; the task is then refused.
    """
    try:
        return planner.named(template, recording_set.labels)
    except InputError:
        return str(planner.base / template)


def _fit(planner: _Planner, recording_set: RecordingSet) -> Task:
    table = planner.file.fit
    assert table is not None
    method = table.options["method"] or (SUBSPACE if planner.file.estimate is None else POLYREFERENCE)
    settings = {"options": {**table.options, "method": method}}
    if method == POLYREFERENCE:
        return Task("fit", recording_set.name, (), (f"estimate:{recording_set.name}",), settings)
    files, checks = _files_and_checks(recording_set.recordings)
    return Task("fit", recording_set.name, files, checks, settings)


def _files_and_checks(recordings: Sequence[FoundRecording]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(str(recording.path) for recording in recordings), tuple(
        f"check:{recording.name}" for recording in recordings
    )


def _diagnoses(
    planner: _Planner,
    recordings: Sequence[FoundRecording],
    sets: Sequence[RecordingSet],
    last: dict[str, dict[str, str]],
) -> Iterator[Task]:
    """Yield one task ``diagnose`` for each group of recordings; add it to the sets that it contains in ``last``."""
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
        members = {recording_set.name for recording_set in group.recordings}
        for recording_set in sets:
            if members.issuperset(recording.name for recording in recording_set.recordings):
                last[recording_set.name]["diagnosis"] = task.identity


def _robot_diagnoses(planner: _Planner, recordings: Sequence[FoundRecording], left_out: list[str]) -> Iterator[Task]:
    table = planner.file.robot_diagnose
    if table is None:
        return
    posed = [recording for recording in recordings if planner.pose_of(recording) is not None]
    left_out += [
        f"{recording.path.name} is left out of the robot's diagnosis: its posture is not known"
        for recording in recordings
        if planner.pose_of(recording) is None and not recording.fault
    ]
    for group in grouped(posed, table.by)[0] if table.by else [all_together(posed, ALL)] if posed else []:
        files, checks = _files_and_checks(group.recordings)
        settings = {
            "options": table.options,
            "robot": _robot_name(planner),
            "poses": [planner.pose_of(recording) for recording in group.recordings],
        }
        yield Task("robot_diagnose", group.name, (*planner.robot_files, *files), checks, settings)


def _learning(
    planner: _Planner, sets: Sequence[RecordingSet], last: dict[str, dict[str, str]], left_out: list[str]
) -> Iterator[Task]:
    table = planner.file.learn
    if table is None:
        return
    posed = [recording_set for recording_set in sets if planner.pose_of(recording_set) is not None]
    left_out += [
        f"set {recording_set.name} is left out of the posture model: its posture is not known, or stated in two ways"
        for recording_set in sets
        if recording_set not in posed
    ]
    settings = {
        "options": table.options,
        "sets_per_pose": table.sets_per_pose,
        "robot": _robot_name(planner),
        "names": [recording_set.name for recording_set in posed],
        "poses": [planner.pose_of(recording_set) for recording_set in posed],
    }
    needs = tuple(last[recording_set.name]["model"] for recording_set in posed)
    yield Task("learn", ALL, planner.robot_files, needs, settings)


def _robot_name(planner: _Planner) -> str | None:
    """Return the name of a built-in robot; leave out the path of a robot file, whose content is part of the key."""
    return None if planner.robot_files else planner.robot
