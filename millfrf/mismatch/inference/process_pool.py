"""Independent work in copies of this process, one for each core: threads would wait for the interpreter's lock."""

import multiprocessing
import os
import pickle
import sys
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.sharedctypes import Synchronized
from typing import Any, TypeVar

from millfrf.core import end_with

Result = TypeVar("Result")


def in_processes(tasks: Sequence[Callable[[], Result]]) -> list[Result]:
    """Results of all tasks, in their order.

    Where a process can be copied with its memory (Linux) and more than one core is free to it, the tasks run in copies
    that hand their results back; otherwise, and for what a copy could not hand back, they run here one after the other.

    Parameters
    ----------
    tasks
        Functions without side effects; what they return can be pickled.

    Raises
    ------
    Exception
        Whatever the first failing task raises.
    """
    workers = min(_cores(), len(tasks))
    found: dict[int, Result] = _in_copies(tasks, workers) if workers > 1 else {}
    return [found[k] if k in found else task() for k, task in enumerate(tasks)]


def _cores() -> int:
    """Cores that this process may use; one where it cannot be copied, or is itself a copy."""
    if not sys.platform.startswith("linux") or multiprocessing.parent_process() is not None:
        return 1
    return len(os.sched_getaffinity(0))


def _in_copies(tasks: Sequence[Callable[[], Result]], workers: int) -> dict[int, Result]:
    """Results by the task's number; a task that failed is missing and fails again where it can be seen."""
    context = multiprocessing.get_context("fork")
    turn = context.Value("i", 0)
    pipes: list[Connection] = []
    copies = []
    for _ in range(workers):
        here, there = context.Pipe(duplex=False)
        copy = context.Process(target=_work, args=(tasks, turn, there, (*pipes, here), os.getpid()), daemon=True)
        copy.start()
        there.close()
        pipes.append(here)
        copies.append(copy)
    found: dict[int, Result] = _received(pipes)
    for copy in copies:
        copy.join()
    return found


def _received(pipes: list[Connection]) -> dict[int, Any]:
    """Results by the task's number, until every copy has closed its pipe."""
    found: dict[int, Any] = {}
    while pipes:
        for pipe in wait(pipes):
            assert isinstance(pipe, Connection)
            try:
                message = pipe.recv_bytes()
            except (EOFError, OSError):
                # the copy has ended, or it died with half a result sent
                pipes.remove(pipe)
                continue
            try:
                number, result = pickle.loads(message)
            except Exception:
                # what cannot be read back is made again by the caller
                continue
            found[number] = result
    return found


def _work(
    tasks: Sequence[Callable[[], Any]],
    turn: "Synchronized[int]",
    pipe: Connection,
    inherited: Sequence[Connection],
    parent: int,
) -> None:
    """Take the next task until none is left; runs in a copy, which does not outlive the process ``parent``."""
    end_with(parent)
    # a reading end that stays open here would let a sibling wait for ever to be read
    for one in inherited:
        one.close()
    while True:
        with turn.get_lock():
            number = turn.value
            turn.value += 1
        if number >= len(tasks):
            return
        try:
            pipe.send((number, tasks[number]()))
        except Exception:
            # it is run again by the caller, whose traceback then tells
            continue
