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
    wanted = {each.identity: each for each in (Task("check", str(number)) for number in range(tasks))}
    result, me = Overhead(), psutil.Process()
    with dask_executor(None, workers, out, probe) as executor:
        children = [each for each in me.children(recursive=True) if "resource_tracker" not in " ".join(each.cmdline())]

        def told(ended: Ended | None) -> None:
            if ended is None:
                return
            result.tasks += 1
            result.statuses.add(ended.status)
            if result.tasks % EVERY == 0 or result.tasks == tasks:
                result.scheduler_bytes = max(result.scheduler_bytes, me.memory_info().rss)
                result.worker_bytes = max(result.worker_bytes, *(each.memory_info().rss for each in children))

        before, begin = _processor_seconds([me]), time.perf_counter()
        of_workers = _processor_seconds(children)
        run_tasks(wanted, State(), lambda _: order, executor, told)
        result.seconds = time.perf_counter() - begin
        result.scheduler_seconds = _processor_seconds([me]) - before
        result.worker_seconds = _processor_seconds(children) - of_workers
    return result


def _processor_seconds(processes: list[psutil.Process]) -> float:
    times = [each.cpu_times() for each in processes]
    return sum(each.user + each.system for each in times)
