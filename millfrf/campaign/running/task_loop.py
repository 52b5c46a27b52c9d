"""The loop of a run: tasks whose needs are met go to the executor, and what comes back makes others ready."""

import heapq
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ..graph import Task
from .executors import Executor
from .one_task import DONE, FULL, REFUSED, Ended, Order

DEPTH = 4
"""Orders that wait at each worker, so that none stands still; the scheduler knows of no more than these."""

TICK = 1.0
"""Seconds after which the loop looks up where nothing ended."""

PASSING = frozenset({"spectra", "join", "sum"})
"""Kinds whose results only other tasks read: where those are there, these need not be."""


@dataclass
class State:
    """What became of the tasks so far.

    Parameters
    ----------
    settled
        Status (``done`` or ``refused``) by identity, of results in the store.
    failed
        Reason by identity, of tasks that are tried again by the next run, and of those that need them.
    full
        Line on a full disk; empty: none.
    """

    settled: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    full: str = ""


def left_to_run(tasks: Mapping[str, Task], settled: Mapping[str, str]) -> list[str]:
    """Identities of tasks to run: not in the store, and wanted, or needed by one that is run."""
    wanted: set[str] = set()
    for identity in reversed(list(tasks)):
        task = tasks[identity]
        if identity not in settled and (task.kind not in PASSING or identity in wanted):
            wanted.update((identity, *task.needs))
    return [identity for identity in tasks if identity in wanted and identity not in settled]


def run_tasks(
    tasks: Mapping[str, Task],
    state: State,
    order_of: Callable[[str], Order],
    executor: Executor,
    told: Callable[[Ended | None], None],
) -> None:
    """Run all tasks that are left; ``state`` is brought up to date as they end.

    Parameters
    ----------
    tasks
        Tasks by identity, each after those that it needs; earlier ones go first.
    state
        What is in the store already.
    order_of
        Function that gives the order of a task.
    executor
        Where tasks run.
    told
        Called with each task that ended, and with None where none did for a while.
    """
    left = left_to_run(tasks, state.settled)
    number = {identity: place for place, identity in enumerate(tasks)}
    missing = {one: sum(need not in state.settled for need in tasks[one].needs) for one in left}
    dependents: dict[str, list[str]] = {}
    for one in left:
        for need in tasks[one].needs:
            dependents.setdefault(need, []).append(one)
    ready = [number[one] for one in left if not missing[one]]
    heapq.heapify(ready)
    names = list(tasks)
    running = 0
    while ready or running:
        while ready and running < DEPTH * max(1, executor.n_workers) and not state.full:
            executor.submit(order_of(names[heapq.heappop(ready)]))
            running += 1
        if not running:
            return
        ended = executor.next_ended(TICK)
        told(ended)
        if ended is None:
            continue
        running -= 1
        if ended.status in (DONE, REFUSED):
            state.settled[ended.identity] = ended.status
            for one in dependents.get(ended.identity, ()):
                missing[one] -= 1
                if not missing[one] and one not in state.failed:
                    heapq.heappush(ready, number[one])
        else:
            _give_up(ended, dependents, state)


def _give_up(ended: Ended, dependents: Mapping[str, list[str]], state: State) -> None:
    """Note a failure, and that all that hangs on it is not run."""
    state.failed[ended.identity] = ended.reason
    if ended.status == FULL:
        state.full = ended.reason
    below = list(dependents.get(ended.identity, ()))
    while below:
        one = below.pop()
        if one not in state.failed:
            state.failed[one] = f"not run: it needs {ended.identity}"
            below += dependents.get(one, ())
