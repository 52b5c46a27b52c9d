"""Execution of tasks in the order of their dependencies, in this process or in workers."""

import contextlib
import heapq
import io
import json
import os
import platform
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol
from urllib.parse import quote

from threadpoolctl import threadpool_limits

from millfrf.core import DiskError, MillfrfError, TooLarge, accepting_edited, is_disk_full
from millfrf.core.content_hashes import EDITED

from .jobs import JOB_OF
from .store import program_digest, read_outcome, store_outcome
from .tasks import Task
from .work import Outcome, Work

DONE, REFUSED, FAILED, DISK, FOREIGN = "done", "refused", "failed", "disk error", "foreign"


@dataclass(frozen=True)
class Order:
    """Message to a worker about one task; only text and numbers, so that it is small."""

    identity: str  # kind:name of the task
    key: str  # of its result
    files: tuple[tuple[str, int, int, str], ...]  # path, size in bytes, time of change in s and SHA-256 of each file
    needs: tuple[tuple[str, str], ...]  # identity and key of each task that it needs
    settings: str  # settings as JSON
    base: str  # folder of the campaign
    out: str  # folder of results
    program: str  # digest of the program that planned it
    edited: bool  # whether files that were edited after they were written are accepted


@dataclass(frozen=True)
class Ended:
    """How a task ended."""

    identity: str  # kind:name of the task
    # ``done``, ``refused`` (stored), ``failed`` or ``disk error`` (not stored, tried again by the next run), or
    # ``foreign`` (the worker has another version of the program; another worker must run the task)
    status: str
    reason: str  # one line; empty: done
    seconds: float  # s


def run_task(order: Order) -> Ended:
    """Run a task unless its result is stored, and store the outcome; raise no exception."""
    started = time.time()
    start = time.perf_counter()
    output = io.StringIO()
    try:
        status, reason, doubts = _done(order, output)
        trace = ""
    except Exception as error:
        status, reason, doubts = (DISK if _is_of_disk(error) else FAILED), _in_one_line(error), ()
        trace = traceback.format_exc()
    seconds = time.perf_counter() - start
    _log(order, (started, seconds), (status, reason), [*doubts, output.getvalue(), trace])
    return Ended(order.identity, status, reason, seconds)


def _done(order: Order, output: io.StringIO) -> tuple[str, str, tuple[str, ...]]:
    if program_digest() != order.program:
        return FOREIGN, f"the worker on {platform.node()} has another version of millfrf or of its libraries", ()
    out = Path(order.out)
    outcome = read_outcome(out, order.identity, order.key)
    if outcome is None:
        with _quiet(output):
            outcome = store_outcome(out, order.identity, order.key, lambda folder: _job(order, folder))
    return (DONE if outcome.done else REFUSED), outcome.reason, outcome.warnings


def _job(order: Order, folder: Path) -> tuple[str, list[str]]:
    """Run the job of a task; return the reason of a refusal (empty: none) and warnings, without local folder names."""
    _require_unchanged(order)
    needs = tuple(_outcome(order, identity, key) for identity, key in order.needs)
    files, digests = tuple(Path(item[0]) for item in order.files), tuple(item[3] for item in order.files)
    work = Work(files, digests, needs, json.loads(order.settings))
    accepting: contextlib.AbstractContextManager[list[str]]
    accepting = accepting_edited() if order.edited else contextlib.nullcontext([])
    try:
        with accepting as edited:
            reason, doubts = "", JOB_OF[order.identity.partition(":")[0]](work, folder)
        doubts = [*(f"{name}: {EDITED}" for name in edited), *doubts]
    except MillfrfError as error:
        if isinstance(error, DiskError | TooLarge):  # depends on this machine, so it must not be stored as a result
            raise
        reason, doubts = str(error) or type(error).__name__, []
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
    _require_unchanged(order)
    return _local(order, folder, reason), [_local(order, folder, item) for item in doubts]


def _outcome(order: Order, identity: str, key: str) -> Outcome:
    outcome = read_outcome(Path(order.out), identity, key)
    if outcome is None:
        raise FileNotFoundError(
            f"the result of {identity} is not in {order.out}; is this folder shared by all workers?"
        )
    return outcome


def _require_unchanged(order: Order) -> None:
    """Raise an OSError, which is not stored, if a file has changed since it was hashed."""
    for path, size, changed, _ in order.files:
        try:
            stat = Path(path).stat()
            current = (stat.st_size, int(stat.st_mtime))
        except OSError:
            current = (-1, 0)
        if current != (size, changed):
            fault = "cannot be read by this worker" if current[0] < 0 else "changed while the campaign ran"
            raise OSError(f"{Path(path).name} {fault}; run the campaign again")


def _local(order: Order, folder: Path, text: str) -> str:
    """Return a text in one line, with paths relative to the folders of the campaign."""
    for folder_name in (str(folder), order.out, order.base):
        text = text.replace(f"{folder_name}{os.sep}", "").replace(folder_name, ".")
    return " ".join(text.split())


def _is_of_disk(error: BaseException) -> bool:
    return isinstance(error, DiskError) or is_disk_full(error)


def _in_one_line(error: Exception) -> str:
    if isinstance(error, OSError | MillfrfError):
        return " ".join(str(error).split())
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
    place = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "an unknown place"
    return f"unforeseen {type(error).__name__} ({place}): {' '.join(str(error).split())[:200]}"


@contextmanager
def _quiet(output: io.StringIO) -> Iterator[None]:
    """Use one thread for linear algebra, and redirect printed text to the log."""
    with (
        threadpool_limits(1),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(output),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def log_of(out: Path, identity: str) -> Path:
    """Return the path of a log, ``logs/<kind>/<name>.log``; forbidden characters are written as %XX."""
    kind, _, name = identity.partition(":")
    return out / "logs" / kind / f"{quote(name, safe=' =,.()+')}.log"


def _log(order: Order, when: tuple[float, float], ended: tuple[str, str], texts: list[str]) -> None:
    path = log_of(Path(order.out), order.identity)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(when[0]))
    lines = [
        f"{began} UTC  {order.identity}  on {platform.node()}, process {os.getpid()}, {when[1]:.3f} s: {ended[0]}",
        f"  result {order.key}",
        *([f"  reason: {ended[1]}"] if ended[1] else []),
        *(f"  {line}" for text in texts if text for line in text.splitlines()),
    ]
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as stream:
            stream.write("\n".join(lines) + "\n")


class Executor(Protocol):
    """Interface of an executor of tasks."""

    @property
    def n_workers(self) -> int:
        """Number of tasks that run at the same time."""

    def submit(self, order: Order) -> None:
        """Queue a task."""

    def next_ended(self, seconds: float) -> Ended | None:
        """Wait for the next task that ends and return how it ended; None if no task ended within ``seconds``."""

    def close(self) -> None:
        """Cancel tasks that have not started."""


class InThisProcess:
    """Executor without worker processes: `next_ended` runs the next task."""

    def __init__(self) -> None:
        self._waiting: deque[Order] = deque()
        self.n_workers = 1

    def submit(self, order: Order) -> None:
        self._waiting.append(order)

    def next_ended(self, seconds: float) -> Ended | None:
        del seconds
        if not self._waiting:
            return None
        ended = run_task(self._waiting.popleft())
        return replace(ended, status=FAILED) if ended.status == FOREIGN else ended

    def close(self) -> None:
        self._waiting.clear()


DEPTH = 4  # tasks queued per worker: enough that no worker idles, few enough for a small scheduler
TICK = 1.0  # s; longest wait for a task before progress is shown again

# intermediate results: they are not needed if the results of the tasks that read them are stored
INTERMEDIATE = frozenset({"spectra", "join", "sum"})


@dataclass
class State:
    """Status of the tasks so far."""

    settled: dict[str, str] = field(default_factory=dict)  # ``done`` or ``refused`` of stored results, by identity
    # reason by identity, of tasks that the next run tries again, and of tasks that depend on them
    failed: dict[str, str] = field(default_factory=dict)
    disk_error: str = ""  # message about a full or failing disk; empty: none


def left_to_run(tasks: Mapping[str, Task], settled: Mapping[str, str]) -> list[str]:
    """Return the tasks to run: those without a stored result that are final or that another task to run needs."""
    needed: set[str] = set()
    for identity in reversed(list(tasks)):
        task = tasks[identity]
        if identity not in settled and (task.kind not in INTERMEDIATE or identity in needed):
            needed.update((identity, *task.needs))
    return [identity for identity in tasks if identity in needed and identity not in settled]


def run_tasks(
    tasks: Mapping[str, Task],
    state: State,
    order_of: Callable[[str], Order],
    executor: Executor,
    report_end: Callable[[Ended | None], None],
) -> None:
    """Run all tasks without stored result; update ``state`` as they end.

    ``report_end`` is called with each task that ended, and with None after each wait in which no task ended.
    """
    left = left_to_run(tasks, state.settled)
    number = {identity: place for place, identity in enumerate(tasks)}
    missing = {identity: sum(need not in state.settled for need in tasks[identity].needs) for identity in left}
    dependents: dict[str, list[str]] = {}
    for identity in left:
        for need in tasks[identity].needs:
            dependents.setdefault(need, []).append(identity)
    # a heap by position in the plan: tasks of one set run together, so early sets are finished early
    ready = [number[identity] for identity in left if not missing[identity]]
    heapq.heapify(ready)
    names = list(tasks)
    running = 0
    while ready or running:
        while ready and running < DEPTH * max(1, executor.n_workers) and not state.disk_error:
            executor.submit(order_of(names[heapq.heappop(ready)]))
            running += 1
        if not running:
            return
        ended = executor.next_ended(TICK)
        report_end(ended)
        if ended is None:
            continue
        running -= 1
        if ended.status in (DONE, REFUSED):
            state.settled[ended.identity] = ended.status
            for identity in dependents.get(ended.identity, ()):
                missing[identity] -= 1
                if not missing[identity] and identity not in state.failed:
                    heapq.heappush(ready, number[identity])
        else:
            _give_up(ended, dependents, state)


def _give_up(ended: Ended, dependents: Mapping[str, list[str]], state: State) -> None:
    """Mark a task and all tasks that depend on it as failed."""
    state.failed[ended.identity] = ended.reason
    if ended.status == DISK:
        state.disk_error = ended.reason
    affected = list(dependents.get(ended.identity, ()))
    while affected:
        identity = affected.pop()
        if identity not in state.failed:
            state.failed[identity] = f"not run: it needs {ended.identity}"
            affected += dependents.get(identity, ())
