"""Tasks from recordings to an FRF: spectra of each, in parts where it is long, then sums in a tree."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

from estimation import count_segments, settings_for

from ...chain import LOCAL, EstimateOptions
from ..configuration import EstimateTable, FoundRecording
from .recording_sets import RecordingSet
from .task import Task

FAN_IN = 8
"""Spectra that one task adds up."""


def options_of(table: EstimateTable) -> EstimateOptions:
    """The options of ``millfrf estimate`` that the table states."""
    return EstimateOptions(
        table.segment_s,
        table.overlap,
        table.window,
        table.stack,
        tuple(table.excitation),
        tuple(table.response),
        table.band_hz,
        table.stream,
        table.estimator,
        table.exclude,
        tuple(table.instrument),
    )


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
    name = table.stream if table.stream is not None else next(iter(streams), "")
    n_samples, rate = streams.get(name, (0, 1.0))
    if table.exclude or n_samples <= table.part_s * rate:
        return [(0, 0)]
    settings = settings_for(rate, table.segment_s, overlap=table.overlap, window=table.window)
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
