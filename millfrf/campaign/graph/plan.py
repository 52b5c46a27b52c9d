"""`Plan`: all tasks of a campaign, in an order in which each comes after those that it needs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from millfrf.core import InputError

from .recording_sets import RecordingSet
from .task import Task


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
