"""What a task costs that has nothing to do, and the memory of scheduler and workers while thousands of them pass."""

import time
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from millfrf.campaign.on_dask import dask_executor
from millfrf.campaign.running import Ended, Order, State, run_tasks
from millfrf.campaign.store import program_digest, store_outcome
from millfrf.campaign.tasks import Task

IDENTITY, KEY = "check:nothing", "0" * 64
EVERY = 200
"""Tasks between two looks at the memory."""


@dataclass
class Overhead:
    """What was measured.

    Parameters
    ----------
    tasks
        Number of tasks that ended.
    seconds, scheduler_seconds, worker_seconds
        Time by the clock, and processor time of the process with the scheduler, and of all workers; s.
    scheduler_bytes, worker_bytes
        Largest resident memory of the scheduler's process, and of a worker.
    """

    tasks: int = 0
    seconds: float = 0.0
    scheduler_seconds: float = 0.0
    worker_seconds: float = 0.0
    scheduler_bytes: int = 0
    worker_bytes: int = 0
    statuses: set[str] = field(default_factory=set)


def overhead_of(tasks: int, workers: int, out: Path) -> Overhead:
    """Send so many tasks to workers whose result is in the store already.

    Each is ordered, sent, looked up in the store, logged and told of, as every task is; only the job is missing.
    """
    (out / "results").mkdir(parents=True, exist_ok=True)
    probe = out / "probe"
    probe.touch()
    store_outcome(out, IDENTITY, KEY, lambda folder: ("", []))
    order = Order(IDENTITY, KEY, (), (), "{}", str(out), str(out), program_digest())
    wanted = {one.identity: one for one in (Task("check", str(number)) for number in range(tasks))}
    found, me = Overhead(), psutil.Process()
    with dask_executor(None, workers, out, probe) as executor:
        children = [one for one in me.children(recursive=True) if "resource_tracker" not in " ".join(one.cmdline())]

        def told(ended: Ended | None) -> None:
            if ended is None:
                return
            found.tasks += 1
            found.statuses.add(ended.status)
            if found.tasks % EVERY == 0 or found.tasks == tasks:
                found.scheduler_bytes = max(found.scheduler_bytes, me.memory_info().rss)
                found.worker_bytes = max(found.worker_bytes, *(one.memory_info().rss for one in children))

        before, begin = _processor_seconds([me]), time.perf_counter()
        of_workers = _processor_seconds(children)
        run_tasks(wanted, State(), lambda _: order, executor, told)
        found.seconds = time.perf_counter() - begin
        found.scheduler_seconds = _processor_seconds([me]) - before
        found.worker_seconds = _processor_seconds(children) - of_workers
    return found


def _processor_seconds(processes: list[psutil.Process]) -> float:
    times = [one.cpu_times() for one in processes]
    return sum(one.user + one.system for one in times)
