"""Execution of tasks: in order of their dependencies, in this process or another."""

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

from millfrf.core import DiskFull, MillfrfError, TooLarge, is_disk_full

from .jobs import JOB_OF
from .store import program_digest, read_outcome, store_outcome
from .tasks import Task
from .work import Outcome, Work

DONE, REFUSED, FAILED, FULL, FOREIGN = "done", "refused", "failed", "disk full", "foreign"


@dataclass(frozen=True)
class Order:
    """What a worker is told of a task: little, and all of it text and numbers.

    Parameters
    ----------
    identity, key
        Kind and name of the task, and the key of its result.
    files
        Path, size in bytes, time of change in s and SHA-256 of each file.
    needs
        Identity and key of each task that it needs.
    settings
        Settings as JSON.
    base, out
        Folder of the campaign and that of results.
    program
        Digest of the program that planned it.
    """

    identity: str
    key: str
    files: tuple[tuple[str, int, int, str], ...]
    needs: tuple[tuple[str, str], ...]
    settings: str
    base: str
    out: str
    program: str


@dataclass(frozen=True)
class Ended:
    """How a task ended.

    Parameters
    ----------
    identity
        Kind and name of the task.
    status
        ``done``, ``refused`` (stored), ``failed`` or ``disk full`` (not stored, tried again by the next run), or
        ``foreign`` (the worker has another version: to be done elsewhere).
    reason
        One line where it was not done.
    seconds : s
        How long it took.
    """

    identity: str
    status: str
    reason: str
    seconds: float


def run_task(order: Order) -> Ended:
    """Do a task, unless its result is there, and store what became of it; nothing is raised."""
    started = time.time()
    clock = time.perf_counter()
    said = io.StringIO()
    try:
        status, reason, doubts = _done(order, said)
        trace = ""
    except Exception as error:
        status, reason, doubts = (FULL if _no_room(error) else FAILED), _in_one_line(order, error), ()
        trace = traceback.format_exc()
    seconds = time.perf_counter() - clock
    _log(order, (started, seconds), (status, reason), [*doubts, said.getvalue(), trace])
    return Ended(order.identity, status, reason, seconds)


def _done(order: Order, said: io.StringIO) -> tuple[str, str, tuple[str, ...]]:
    if program_digest() != order.program:
        return FOREIGN, f"the worker on {platform.node()} has another version of millfrf or of its libraries", ()
    out = Path(order.out)
    found = read_outcome(out, order.identity, order.key)
    if found is None:
        with _quiet(said):
            found = store_outcome(out, order.identity, order.key, lambda folder: _job(order, folder))
    return (DONE if found.done else REFUSED), found.reason, found.warnings


def _job(order: Order, folder: Path) -> tuple[str, list[str]]:
    """Reason of a refusal (empty: none) and doubts, without the names of folders of this machine."""
    _require_unchanged(order)
    needs = tuple(_outcome(order, identity, key) for identity, key in order.needs)
    files, digests = tuple(Path(one[0]) for one in order.files), tuple(one[3] for one in order.files)
    work = Work(files, digests, needs, json.loads(order.settings))
    try:
        reason, doubts = "", JOB_OF[order.identity.partition(":")[0]](work, folder)
    except MillfrfError as error:
        if _no_room(error) or isinstance(error, TooLarge):  # of this machine or its settings, not of the input
            raise
        reason, doubts = str(error) or type(error).__name__, []
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
    _require_unchanged(order)
    return _local(order, folder, reason), [_local(order, folder, one) for one in doubts]


def _outcome(order: Order, identity: str, key: str) -> Outcome:
    found = read_outcome(Path(order.out), identity, key)
    if found is None:
        raise FileNotFoundError(
            f"the result of {identity} is not in {order.out}; is this folder shared by all workers?"
        )
    return found


def _require_unchanged(order: Order) -> None:
    """Refuse, without storing it, work on a file that is not what its hash was taken from."""
    for path, size, changed, _ in order.files:
        try:
            now = Path(path).stat()
            seen = (now.st_size, int(now.st_mtime))
        except OSError:
            seen = (-1, 0)
        if seen != (size, changed):
            what = "is not to be seen from this worker" if seen[0] < 0 else "changed while the campaign ran"
            raise OSError(f"{Path(path).name} {what}; run the campaign again")


def _local(order: Order, folder: Path, text: str) -> str:
    """Text in one line, its paths told from the folders of the campaign."""
    for one in (str(folder), order.out, order.base):
        text = text.replace(f"{one}{os.sep}", "").replace(one, ".")
    return " ".join(text.split())


def _no_room(error: BaseException) -> bool:
    return isinstance(error, DiskFull) or is_disk_full(error)


def _in_one_line(order: Order, error: Exception) -> str:
    if isinstance(error, OSError | MillfrfError):
        return " ".join(str(error).split())
    frames = [one for one in traceback.extract_tb(error.__traceback__) if "site-packages" not in one.filename]
    place = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "an unknown place"
    return f"unforeseen {type(error).__name__} ({place}): {' '.join(str(error).split())[:200]}"


@contextmanager
def _quiet(said: io.StringIO) -> Iterator[None]:
    """One thread for linear algebra; what is printed or warned of goes into the log."""
    with (
        threadpool_limits(1),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def log_of(out: Path, identity: str) -> Path:
    """Log of a task: ``logs/<kind>/<name>.log``; letters that no file name may hold are written as %XX."""
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
    """Takes orders and tells how they ended."""

    @property
    def n_workers(self) -> int:
        """Number of tasks that run at a time."""

    def submit(self, order: Order) -> None:
        """Take an order."""

    def next_ended(self, seconds: float) -> Ended | None:
        """How the next task ended; None: none did within some seconds."""

    def close(self) -> None:
        """Give up what has not begun."""


class InThisProcess:
    """Runs one task after the other, when it is asked how the next one ended."""

    def __init__(self) -> None:
        self._waiting: deque[Order] = deque()
        self.n_workers = 1

    def submit(self, order: Order) -> None:
        """Take an order."""
        self._waiting.append(order)

    def next_ended(self, seconds: float) -> Ended | None:
        """Do the next task."""
        del seconds
        if not self._waiting:
            return None
        ended = run_task(self._waiting.popleft())
        return replace(ended, status=FAILED) if ended.status == FOREIGN else ended

    def close(self) -> None:
        """Give up what has not begun."""
        self._waiting.clear()


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
