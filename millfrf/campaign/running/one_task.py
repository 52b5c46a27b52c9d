"""One task, wherever it runs: in this process, or in a worker on any machine that sees the folder of results."""

import contextlib
import io
import json
import os
import platform
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from threadpoolctl import threadpool_limits

from millfrf.core import DiskFull, MillfrfError, TooLarge, is_disk_full

from ..jobs import JOB_OF, Outcome, Work
from .same_program import program_digest
from .store import read_outcome, store_outcome

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
