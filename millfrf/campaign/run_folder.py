"""The folder of results: one run at a time, lists of failures and results."""

import csv
import os
import shutil
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from millfrf.core import InputError, LeftoverRemoved, remove_leftovers, writing_whole_file

from .opened import OpenedCampaign
from .planning import ALL
from .running import State, log_of
from .store import RESULTS, folder_of, program_digest, read_outcome
from .tasks import RecordingSet, Task, key_of

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows
    _fcntl = None

LOCK, PROGRAM = ".running", ".program"

WRITTEN = ("report.html", "modes.csv", "modes.parquet", "tasks.csv", "failures.csv", "doubts.csv", "recordings.json")
"""Files that every run writes anew into its folder: in a folder of something else they may be a user's own."""


@contextmanager
def only_run(out: Path) -> Iterator[None]:
    """Hold the folder of results for this run, made if need be.

    Raises
    ------
    InputError
        Another run works there, the folder cannot be made or written to, or it holds files that a run would replace
        and no campaign has written.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder with --out")
    _refuse_foreign(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(out / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"cannot write into {out}: {error.strerror}; choose another --out") from error
    try:
        if _fcntl is not None:
            try:
                _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError(f"another run works in {out}; wait for it, or choose another --out") from error
            except OSError:  # a disk without locks
                pass
        _remove_unfinished(out)
        (out / PROGRAM).write_text(program_digest(), encoding="utf-8")
        yield
    finally:
        os.close(descriptor)


def _refuse_foreign(out: Path) -> None:
    if (out / LOCK).exists() or (out / RESULTS).is_dir():
        return
    found = [name for name in WRITTEN if (out / name).exists()]
    if found:
        raise InputError(f"{out / found[0]} exists and is of no campaign; name another folder with --out")


def program_changed(out: Path) -> bool:
    """Whether the last run in a folder was one of another version, whose results do not count now."""
    try:
        return (out / PROGRAM).read_text(encoding="utf-8") != program_digest()
    except OSError:
        return False


def _remove_unfinished(out: Path) -> None:
    """Remove what killed workers left unfinished in the store; those of living ones stay."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftoverRemoved)
        for folder in (out, *(out / RESULTS).glob("*/*")):
            if folder.is_dir():
                remove_leftovers(folder)


SUMMARY = "summary"


def report_task(opened: OpenedCampaign, state: State, lines: list[str]) -> Task:
    """The task that writes the report of what is there.

    Parameters
    ----------
    opened
        Campaign that was opened: files, tasks, keys.
    state
        What became of the other tasks.
    lines
        One line for each recording or step that failed.
    """
    plan = opened.plan
    learned = f"learn:{ALL}" if f"learn:{ALL}" in plan.tasks else ""
    asked = [identity for results in plan.last.values() for identity in results.values()]
    needs = tuple(dict.fromkeys(one for one in [*asked, *([learned] if learned else [])] if one in state.settled))
    settings = {
        "title": opened.file.campaign.title,
        "robot": None if opened.robot is None or Path(opened.robot).is_file() else opened.robot,
        "learned": learned,
        "sets": [_stored(opened, one, state) for one in plan.sets],
        "failures": lines,
    }
    files = (opened.robot,) if opened.robot is not None and Path(opened.robot).is_file() else ()
    return Task("report", ALL, files, needs, settings)


def _stored(opened: OpenedCampaign, one: RecordingSet, state: State) -> dict[str, Any]:
    """A set as the report's settings hold it."""
    results = dict(opened.plan.last[one.name])
    posture = opened.postures.driven(one)
    return {
        "name": one.name,
        "labels": one.labels,
        "posture": None if posture is None else list(posture),
        "recorded_at": one.recorded_at,
        "recordings": [each.path.name for each in one.recordings],
        "results": results,
        "failures": _failures(opened, one, state),
    }


def _failures(opened: OpenedCampaign, one: RecordingSet, state: State) -> list[str]:
    """A line for each step of a set that was refused or failed."""
    own = [f"check:{each.name}" for each in one.recordings]
    steps = [f"{kind}:{one.name}" for kind in ("estimate", "fit", "calibrate", "lobes")]
    found = []
    for identity in (*own, *steps, opened.plan.last[one.name].get("diagnosis", "")):
        reason = reason_of(opened, state, identity)
        if reason:
            found.append(f"{identity.partition(':')[0]} of {identity.partition(':')[2]}: {reason}")
    return found


def reason_of(opened: OpenedCampaign, state: State, identity: str) -> str:
    """Why a task was not done; empty: it was, or there is none of that name."""
    if identity in state.failed:
        return state.failed[identity]
    key = opened.keys.get(identity)
    if state.settled.get(identity) != "refused" or key is None:
        return ""
    found = read_outcome(opened.out, identity, key)
    return "" if found is None else found.reason


def report_key(opened: OpenedCampaign, task: Task) -> str:
    """Key of the report's result."""
    digests = [opened.looks[path].digest for path in task.files]
    return key_of(task, digests, [opened.keys[need] or "" for need in task.needs], program_digest())


def publish(out: Path, key: str) -> bool:
    """Put the report's files from the store into ``summary``, each whole; False: they are there already."""
    source, target = folder_of(out, "report", key), out / SUMMARY
    wanted = {path.relative_to(source) for path in source.rglob("*") if path.is_file() and path.name != "outcome.json"}
    present = {path.relative_to(target) for path in target.rglob("*") if path.is_file()} if target.is_dir() else set()
    changed = False
    for name in sorted(wanted):
        if name in present and (target / name).read_bytes() == (source / name).read_bytes():
            continue
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        with writing_whole_file(target / name) as temporary:
            shutil.copyfile(source / name, temporary)
        changed = True
    for name in sorted(present - wanted):
        (target / name).unlink()
        changed = True
    return changed


FAILURES, TASKS, DOUBTS = "failures.csv", "tasks.csv", "doubts.csv"


def failure_rows(opened: OpenedCampaign, state: State) -> list[tuple[str, str, str, str]]:
    """Kind, name, what became of it and the reason, for each task that was not done."""
    rows = []
    for identity, task in opened.plan.tasks.items():
        if identity in state.failed or state.settled.get(identity) == "refused":
            became = "failed" if identity in state.failed else "refused"
            rows.append((task.kind, task.name, became, reason_of(opened, state, identity)))
    return rows


def root_lines(rows: Iterable[tuple[str, str, str, str]]) -> list[str]:
    """A line for each failure that is not only the consequence of another."""
    seen: dict[str, str] = {}
    for kind, name, _, reason in rows:
        if not reason.startswith(("no check: ", "not run: it needs ", "no fit: ", "no estimate: ", "no calibrate: ")):
            seen.setdefault(f"{kind} {name}: {reason}", "")
    return list(seen)


def doubt_rows(opened: OpenedCampaign, state: State) -> list[tuple[str, str, str]]:
    """Kind, name and doubt, for each doubt about a result."""
    rows = []
    for identity, task in opened.plan.tasks.items():
        key = opened.keys[identity]
        found = read_outcome(opened.out, identity, key) if key and identity in state.settled else None
        rows += [(task.kind, task.name, doubt) for doubt in (() if found is None else found.warnings)]
    return rows


def recording_lines(doubts: Iterable[tuple[str, str, str]]) -> list[str]:
    """A line for each doubt about a recording by itself."""
    return [f"{name} is doubted: {doubt}" for kind, name, doubt in doubts if kind == "check"]


def write_lists(
    opened: OpenedCampaign,
    state: State,
    rows: Sequence[tuple[str, str, str, str]],
    doubts: Sequence[tuple[str, str, str]],
) -> None:
    """Write ``failures.csv``, ``doubts.csv`` and ``tasks.csv`` into the folder of results."""
    _write(opened.out / FAILURES, ("kind", "name", "became", "reason"), rows)
    _write(opened.out / DOUBTS, ("kind", "name", "doubt"), doubts)
    tasks = []
    for identity, task in opened.plan.tasks.items():
        key = opened.keys[identity]
        status = "failed" if identity in state.failed else state.settled.get(identity, "not needed")
        folder = folder_of(opened.out, task.kind, key).relative_to(opened.out).as_posix() if key else ""
        log = log_of(opened.out, identity).relative_to(opened.out).as_posix()
        tasks.append((task.kind, task.name, status, folder if identity in state.settled else "", log))
    _write(opened.out / TASKS, ("kind", "name", "became", "result", "log"), tasks)


def _write(path: Path, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    with (
        writing_whole_file(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as stream,
    ):
        writer = csv.writer(stream)
        writer.writerow(head)
        writer.writerows(rows)
