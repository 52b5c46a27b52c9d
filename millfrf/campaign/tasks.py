"""Tasks of a campaign: sets of recordings, dependencies, and the key of each result."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import fmean
from typing import Any

from millfrf.core import InputError

from .labels import shown_value
from .recordings import FoundRecording, agree


@dataclass(frozen=True)
class Task:
    """One piece of work: its kind, its input files, its settings and the tasks that must run before it."""

    kind: str  # such as ``spectra`` or ``fit``
    name: str  # name of the recording or set; unique among the tasks of one kind
    files: tuple[str, ...] = ()  # paths of input files, without results of other tasks
    needs: tuple[str, ...] = ()  # identities of the tasks whose results are inputs
    settings: Mapping[str, Any] = field(default_factory=dict)  # must be JSON: the key is a hash of it

    @property
    def identity(self) -> str:
        """Kind and name, such as ``fit:P07``."""
        return f"{self.kind}:{self.name}"


def key_of(task: Task, digests: Sequence[str], keys_of_needs: Sequence[str], program: str) -> str:
    """Return the SHA-256 (hexadecimal) of all inputs of a result.

    The name of the task is no input. The names of its files are, because results state them.

    Examples
    --------
    >>> first = Task("fit", "P01", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> second = Task("fit", "P02", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> key_of(first, [], ["ab"], "1") == key_of(second, [], ["ab"], "1")
    True
    >>> key_of(first, [], ["ab"], "1") == key_of(first, [], ["cd"], "1")
    False
    """
    content = {
        "kind": task.kind,
        "settings": dict(task.settings),
        "files": [[Path(path).name, digest] for path, digest in zip(task.files, digests, strict=True)],
        "needs": list(keys_of_needs),
        "program": program,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def keys_of(tasks: Mapping[str, Task], digests: Mapping[str, str], program: str) -> dict[str, str | None]:
    """Return the key of every task, or None if the hash of one of its inputs is not known yet."""
    keys: dict[str, str | None] = {}
    for identity, task in tasks.items():
        of_files, of_needs = [digests[path] for path in task.files], [keys[need] for need in task.needs]
        known = all(of_files) and all(of_needs)
        keys[identity] = key_of(task, of_files, [key for key in of_needs if key], program) if known else None
    return keys


Value = str | float


@dataclass(frozen=True)
class RecordingSet:
    """Recordings that are averaged or diagnosed together."""

    name: str  # such as ``P07 session=2``
    recordings: tuple[FoundRecording, ...]
    labels: dict[str, Value]  # common labels; numbers that differ are averaged
    posture_deg: tuple[float, ...] | None  # (n_active,), deg or m; None unless all recordings agree

    @property
    def recorded_at(self) -> float | None:
        """Mean time of the recordings, s since 1970."""
        times = [recording.recorded_at for recording in self.recordings if recording.recorded_at is not None]
        return fmean(times) if times else None


def grouped(recordings: Sequence[FoundRecording], by: Sequence[str]) -> tuple[list[RecordingSet], list[FoundRecording]]:
    """Group recordings with equal labels into sets; also return the recordings that lack one of the labels.

    Without labels in ``by`` each recording is a set.
    """
    if not by:
        return [_set_of(recording.name, [recording]) for recording in recordings], []
    for label in by:
        if not any(label in recording.labels.values for recording in recordings):
            known = sorted({name for recording in recordings for name in recording.labels.values})
            raise InputError(
                f"by = {list(by)}: no recording has the label {label}; they have {', '.join(known) or 'none'}"
            )
    groups: dict[tuple[Value, ...], list[FoundRecording]] = {}
    lacking = []
    for recording in recordings:
        values = recording.labels.values
        if all(label in values for label in by):
            groups.setdefault(tuple(values[label] for label in by), []).append(recording)
        else:
            lacking.append(recording)
    # clashes are possible although labels differ: text 2 and number 2 are shown alike
    sets = [_set_of(_name(by, values), members) for values, members in groups.items()]
    _refuse_clashes(sets)
    return sorted(sets, key=lambda recording: recording.name), lacking


def all_together(recordings: Sequence[FoundRecording], name: str) -> RecordingSet:
    return _set_of(name, recordings)


def _name(by: Sequence[str], values: Sequence[Value]) -> str:
    return " ".join(
        value if isinstance(value, str) else f"{label}={shown_value(value)}"
        for label, value in zip(by, values, strict=True)
    )


def _refuse_clashes(sets: Sequence[RecordingSet]) -> None:
    seen: dict[str, RecordingSet] = {}
    for recording_set in sets:
        first = seen.setdefault(recording_set.name, recording_set)
        if first is not recording_set:
            raise InputError(
                f"two sets have the name {recording_set.name}: that of {first.recordings[0].path.name} and that of "
                f"{recording_set.recordings[0].path.name}; write the values of their labels apart"
            )


def _set_of(name: str, members: Sequence[FoundRecording]) -> RecordingSet:
    # recordings with a fault must not change the labels of the set; if all recordings have a fault, they all count
    usable = [recording for recording in members if not recording.fault] or list(members)
    shared: dict[str, Value] = {}
    for label in usable[0].labels.values:
        values = [recording.labels.values.get(label) for recording in usable]
        numbers = [value for value in values if isinstance(value, float)]
        if len(numbers) == len(values):
            shared[label] = numbers[0] if len(set(numbers)) == 1 else fmean(numbers)
        elif len(set(values)) == 1 and isinstance(values[0], str):
            shared[label] = values[0]
    return RecordingSet(
        name, tuple(members), shared, _one_posture([recording.labels.posture_deg for recording in usable])
    )


def _one_posture(stated: Sequence[tuple[float, ...] | None]) -> tuple[float, ...] | None:
    """Return the first stated posture if all stated postures agree, else None."""
    postures = [posture for posture in stated if posture is not None]
    return postures[0] if postures and all(agree(postures[0], posture) for posture in postures) else None


@dataclass(frozen=True)
class Plan:
    """Tasks of a campaign."""

    tasks: Mapping[str, Task]  # by identity, in an order in which they can run
    sets: tuple[RecordingSet, ...]
    # identities of a set's tasks, by the kind of the result that a reader asks for (``model``, ``lobes``,
    # ``diagnosis``), for each set by name
    last: Mapping[str, Mapping[str, str]]
    # one line for each recording that no set holds, and for each set that a job leaves out
    left_out: tuple[str, ...] = ()


def in_order(tasks: Iterable[Task]) -> dict[str, Task]:
    """Sort tasks so that each task comes after the tasks that it needs; otherwise keep their order.

    Examples
    --------
    >>> list(in_order([Task("fit", "a", needs=("estimate:a",)), Task("estimate", "a")]))
    ['estimate:a', 'fit:a']
    >>> in_order([Task("fit", "a", needs=("lobes:a",)), Task("lobes", "a", needs=("fit:a",))])
    Traceback (most recent call last):
    ...
    millfrf.core.errors.InputError: tasks need each other: fit:a needs lobes:a needs fit:a; take one of them out
    """
    known: dict[str, Task] = {}
    for task in tasks:
        if task.identity in known:
            raise InputError(f"two tasks have the name {task.identity}; give recordings and labels names of their own")
        known[task.identity] = task
    for task in known.values():
        for need in task.needs:
            if need not in known:
                raise InputError(f"task {task.identity} needs {need}, which is no task of this campaign")
    # TopologicalSorter would group tasks by depth: an order that is valid already keeps sets together
    if _already_in_order(known):
        return known
    try:
        order = list(TopologicalSorter({name: task.needs for name, task in known.items()}).static_order())
    except CycleError as error:
        cycle = reversed([str(identity) for identity in error.args[1]])
        raise InputError(f"tasks need each other: {' needs '.join(cycle)}; take one of them out") from error
    return {name: known[name] for name in order}


def _already_in_order(known: Mapping[str, Task]) -> bool:
    seen: set[str] = set()
    for name, task in known.items():
        if not seen.issuperset(task.needs):
            return False
        seen.add(name)
    return True
