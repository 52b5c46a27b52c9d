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
    """One piece of work: what is done, with which files, after which other tasks.

    Parameters
    ----------
    kind
        Kind of the work, such as ``spectra`` or ``fit``.
    name
        Name of what it is done with; unlike that of every other task of the kind.
    files
        Paths of the files that it reads, besides results of other tasks.
    needs
        Identities of the tasks whose results it reads.
    settings
        Settings as JSON knows them: numbers, text, lists, tables.
    """

    kind: str
    name: str
    files: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def identity(self) -> str:
        """Kind and name, such as ``fit:P07``."""
        return f"{self.kind}:{self.name}"


def key_of(task: Task, digests: Sequence[str], keys_of_needs: Sequence[str], program: str) -> str:
    """SHA-256 over all that the result depends on, as hexadecimal text.

    Parameters
    ----------
    task
        Task whose result is meant. Its own name does not count; names of its files do, since results state them.
    digests
        SHA-256 of each of its files.
    keys_of_needs
        Key of each task that it needs.
    program
        Digest of the program and of the libraries that compute.

    Examples
    --------
    >>> one = Task("fit", "P01", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> other = Task("fit", "P02", needs=("estimate:P01",), settings={"band_hz": [8.0, 60.0]})
    >>> key_of(one, [], ["ab"], "1") == key_of(other, [], ["ab"], "1")
    True
    >>> key_of(one, [], ["ab"], "1") == key_of(one, [], ["cd"], "1")
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
    """Key of every task; None where the content of a file that it hangs on is not known yet.

    Parameters
    ----------
    tasks
        Tasks by identity, each after those that it needs.
    digests
        SHA-256 by path of the file; empty: not known.
    program
        Digest of the program and of the libraries that compute.
    """
    keys: dict[str, str | None] = {}
    for identity, task in tasks.items():
        of_files, of_needs = [digests[path] for path in task.files], [keys[need] for need in task.needs]
        known = all(of_files) and all(of_needs)
        keys[identity] = key_of(task, of_files, [key for key in of_needs if key], program) if known else None
    return keys


Value = str | float


@dataclass(frozen=True)
class RecordingSet:
    """Recordings that are stacked, or diagnosed, together.

    Parameters
    ----------
    name
        Name of the set, such as ``P07 session=2``.
    recordings
        Its recordings, by name.
    labels
        Labels that they share; numbers that differ stand as their mean.
    posture_deg : (n_active,), deg or m
        Joint values that all of them state, or None.
    """

    name: str
    recordings: tuple[FoundRecording, ...]
    labels: dict[str, Value]
    posture_deg: tuple[float, ...] | None

    @property
    def recorded_at(self) -> float | None:
        """Mean time of its recordings, s since 1970, or None."""
        times = [one.recorded_at for one in self.recordings if one.recorded_at is not None]
        return fmean(times) if times else None


def grouped(recordings: Sequence[FoundRecording], by: Sequence[str]) -> tuple[list[RecordingSet], list[FoundRecording]]:
    """Sets of recordings with equal labels, and the recordings that lack one of them.

    Parameters
    ----------
    recordings
        Recordings of the campaign, labelled.
    by
        Labels that must be equal; none: each recording is a set of its own.

    Raises
    ------
    InputError
        A label that no recording has, or two sets of one name.
    """
    if not by:
        return [_set_of(one.name, [one]) for one in recordings], []
    for label in by:
        if not any(label in one.labels.values for one in recordings):
            known = sorted({each for one in recordings for each in one.labels.values})
            raise InputError(
                f"by = {list(by)}: no recording has the label {label}; they have {', '.join(known) or 'none'}"
            )
    together: dict[tuple[Value, ...], list[FoundRecording]] = {}
    lacking = []
    for one in recordings:
        values = one.labels.values
        if all(label in values for label in by):
            together.setdefault(tuple(values[label] for label in by), []).append(one)
        else:
            lacking.append(one)
    sets = [_set_of(_name(by, values), members) for values, members in together.items()]
    _refuse_clashes(sets)
    return sorted(sets, key=lambda one: one.name), lacking


def all_together(recordings: Sequence[FoundRecording], name: str) -> RecordingSet:
    """One set of all recordings."""
    return _set_of(name, recordings)


def _name(by: Sequence[str], values: Sequence[Value]) -> str:
    """Text as it stands, numbers with their label."""
    return " ".join(
        value if isinstance(value, str) else f"{label}={shown_value(value)}"
        for label, value in zip(by, values, strict=True)
    )


def _refuse_clashes(sets: Sequence[RecordingSet]) -> None:
    seen: dict[str, RecordingSet] = {}
    for one in sets:
        first = seen.setdefault(one.name, one)
        if first is not one:
            raise InputError(
                f"two sets have the name {one.name}: that of {first.recordings[0].path.name} and that of "
                f"{one.recordings[0].path.name}; write the values of their labels apart"
            )


def _set_of(name: str, members: Sequence[FoundRecording]) -> RecordingSet:
    sound = [one for one in members if not one.fault] or list(members)
    shared: dict[str, Value] = {}
    for label in sound[0].labels.values:
        values = [one.labels.values.get(label) for one in sound]
        numbers = [value for value in values if isinstance(value, float)]
        if len(numbers) == len(values):
            shared[label] = numbers[0] if len(set(numbers)) == 1 else fmean(numbers)
        elif len(set(values)) == 1 and isinstance(values[0], str):
            shared[label] = values[0]
    return RecordingSet(name, tuple(members), shared, _one_posture([one.labels.posture_deg for one in sound]))


def _one_posture(stated: Sequence[tuple[float, ...] | None]) -> tuple[float, ...] | None:
    """The first of the postures that are stated, if they agree; else None."""
    known = [one for one in stated if one is not None]
    return known[0] if known and all(agree(known[0], one) for one in known) else None


@dataclass(frozen=True)
class Plan:
    """What a campaign does.

    Parameters
    ----------
    tasks
        Tasks by identity, each after those that it needs.
    sets
        Recordings that are stacked.
    last
        Identities of a set's tasks, by the kind of the result that a reader asks for (``model``, ``lobes``,
        ``diagnosis``), for each set by name.
    left_out
        One line for each recording that no set holds, and for each set that a job leaves out.
    """

    tasks: Mapping[str, Task]
    sets: tuple[RecordingSet, ...]
    last: Mapping[str, Mapping[str, str]]
    left_out: tuple[str, ...] = ()


def in_order(tasks: Iterable[Task]) -> dict[str, Task]:
    """Tasks by identity, those that are needed first, else in the order in which they are given.

    Raises
    ------
    InputError
        Two tasks of one name, a task that needs one that is not there, or tasks that need each other.

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
    if _already_in_order(known):
        return known
    try:
        order = list(TopologicalSorter({name: task.needs for name, task in known.items()}).static_order())
    except CycleError as error:
        circle = reversed([str(one) for one in error.args[1]])
        raise InputError(f"tasks need each other: {' needs '.join(circle)}; take one of them out") from error
    return {name: known[name] for name in order}


def _already_in_order(known: Mapping[str, Task]) -> bool:
    seen: set[str] = set()
    for name, task in known.items():
        if not seen.issuperset(task.needs):
            return False
        seen.add(name)
    return True
