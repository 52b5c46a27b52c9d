"""The folder of results: one run at a time, lists of failures and results."""

import os
import shutil
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from millfrf.core import InputError, LeftoverRemoved, remove_leftovers, side_file, write_csv, writing_whole_file
from millfrf.core.file_locks import lock

from .opened import OpenedCampaign
from .planning import ALL
from .running import State, log_of
from .store import RESULTS, folder_of, program_digest, read_outcome
from .tasks import RecordingSet, Task, key_of

LOCK, PROGRAM = ".running", ".program"

# every run overwrites these files: in a folder without results they may belong to the user
_TABLES = ("modes.csv", "tasks.csv", "failures.csv", "doubts.csv")
WRITTEN = ("report.html", "modes.parquet", "recordings.json", *_TABLES, *(side_file(name).name for name in _TABLES))


@contextmanager
def only_run(out: Path) -> Iterator[None]:
    """Create and lock the folder of results for this run."""
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder with --out")
    _refuse_foreign(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(out / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"cannot write into {out}: {error.strerror}; choose another --out") from error
    try:
        if lock(descriptor) is False:  # on a disk without locks results stay correct, work may be done twice
            raise InputError(f"another run uses {out}; wait for it, or choose another --out")
        _remove_unfinished(out)
        (out / PROGRAM).write_text(program_digest(), encoding="utf-8")
        yield
    finally:
        os.close(descriptor)


def _refuse_foreign(out: Path) -> None:
    if (out / LOCK).exists() or (out / RESULTS).is_dir():
        return
    existing = [name for name in WRITTEN if (out / name).exists()]
    if existing:
        raise InputError(
            f"{out / existing[0]} exists, and no campaign has written this folder; name another folder with --out"
        )


def program_changed(out: Path) -> bool:
    """Return whether another version of the program made the last run in a folder; its results are not used."""
    try:
        return (out / PROGRAM).read_text(encoding="utf-8") != program_digest()
    except OSError:
        return False


def _remove_unfinished(out: Path) -> None:
    """Remove the temporary folders of killed workers; keep the folders of living workers."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftoverRemoved)
        for folder in (out, *(out / RESULTS).glob("*/*")):
            if folder.is_dir():
                remove_leftovers(folder)


SUMMARY = "summary"


def report_task(opened: OpenedCampaign, state: State, lines: list[str]) -> Task:
    """Return the task that writes the report of all stored results."""
    plan = opened.plan
    learned = f"learn:{ALL}" if f"learn:{ALL}" in plan.tasks else ""
    requested = [identity for results in plan.last.values() for identity in results.values()]
    needs = tuple(
        dict.fromkeys(
            identity for identity in [*requested, *([learned] if learned else [])] if identity in state.settled
        )
    )
    settings = {
        "title": opened.file.campaign.title,
        "robot": None if opened.robot is None or Path(opened.robot).is_file() else opened.robot,
        "learned": learned,
        "sets": [_stored(opened, identity, state) for identity in plan.sets],
        "failures": lines,
    }
    files = (opened.robot,) if opened.robot is not None and Path(opened.robot).is_file() else ()
    return Task("report", ALL, files, needs, settings)


def _stored(opened: OpenedCampaign, recording_set: RecordingSet, state: State) -> dict[str, Any]:
    """Convert a set to the settings of the report."""
    results = dict(opened.plan.last[recording_set.name])
    posture = opened.postures.driven(recording_set)
    return {
        "name": recording_set.name,
        "labels": recording_set.labels,
        "posture": None if posture is None else list(posture),
        "recorded_at": recording_set.recorded_at,
        "recordings": [recording.path.name for recording in recording_set.recordings],
        "results": results,
        "failures": _failures(opened, recording_set, state),
    }


def _failures(opened: OpenedCampaign, recording_set: RecordingSet, state: State) -> list[str]:
    """Return one line for each step of a set that was refused or failed."""
    checks = [f"check:{recording.name}" for recording in recording_set.recordings]
    steps = [f"{kind}:{recording_set.name}" for kind in ("estimate", "fit", "calibrate", "lobes")]
    lines = []
    for identity in (*checks, *steps, opened.plan.last[recording_set.name].get("diagnosis", "")):
        reason = reason_of(opened, state, identity)
        if reason:
            lines.append(f"{identity.partition(':')[0]} of {identity.partition(':')[2]}: {reason}")
    return lines


def reason_of(opened: OpenedCampaign, state: State, identity: str) -> str:
    """Return the reason why a task was not done; an empty text if it was done or does not exist."""
    if identity in state.failed:
        return state.failed[identity]
    key = opened.keys.get(identity)
    if state.settled.get(identity) != "refused" or key is None:
        return ""
    outcome = read_outcome(opened.out, identity, key)
    return "" if outcome is None else outcome.reason


def report_key(opened: OpenedCampaign, task: Task) -> str:
    digests = [opened.looks[path].digest for path in task.files]
    return key_of(task, digests, [opened.keys[need] or "" for need in task.needs], program_digest())


def publish(out: Path, key: str) -> bool:
    """Copy the files of the report from the store into ``summary``, each atomically; return whether any changed."""
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
    """Return kind, name, status and reason of each task that was not done."""
    rows = []
    for identity, task in opened.plan.tasks.items():
        if identity in state.failed or state.settled.get(identity) == "refused":
            status = "failed" if identity in state.failed else "refused"
            rows.append((task.kind, task.name, status, reason_of(opened, state, identity)))
    return rows


def root_lines(rows: Iterable[tuple[str, str, str, str]]) -> list[str]:
    """Return one line for each failure; leave out tasks that were not run because a task before them failed."""
    lines: dict[str, str] = {}
    for kind, name, _, reason in rows:
        if not reason.startswith(("no check: ", "not run: it needs ", "no fit: ", "no estimate: ", "no calibrate: ")):
            lines.setdefault(f"{kind} {name}: {reason}", "")
    return list(lines)


def doubt_rows(opened: OpenedCampaign, state: State) -> list[tuple[str, str, str]]:
    """Return kind, name and text of each warning about a result."""
    rows = []
    for identity, task in opened.plan.tasks.items():
        key = opened.keys[identity]
        outcome = read_outcome(opened.out, identity, key) if key and identity in state.settled else None
        rows += [(task.kind, task.name, doubt) for doubt in (() if outcome is None else outcome.warnings)]
    return rows


def recording_lines(doubts: Iterable[tuple[str, str, str]]) -> list[str]:
    """Return one line for each warning about a single recording."""
    return [f"{name}: warning: {doubt}" for kind, name, doubt in doubts if kind == "check"]


def write_lists(
    opened: OpenedCampaign,
    state: State,
    rows: Sequence[tuple[str, str, str, str]],
    doubts: Sequence[tuple[str, str, str]],
) -> None:
    """Write ``failures.csv``, ``doubts.csv`` and ``tasks.csv``."""
    write_csv(opened.out / FAILURES, ("kind", "name", "became", "reason"), rows)
    write_csv(opened.out / DOUBTS, ("kind", "name", "doubt"), doubts)
    tasks = []
    for identity, task in opened.plan.tasks.items():
        key = opened.keys[identity]
        status = "failed" if identity in state.failed else state.settled.get(identity, "not needed")
        folder = folder_of(opened.out, task.kind, key).relative_to(opened.out).as_posix() if key else ""
        log = log_of(opened.out, identity).relative_to(opened.out).as_posix()
        tasks.append((task.kind, task.name, status, folder if identity in state.settled else "", log))
    write_csv(opened.out / TASKS, ("kind", "name", "became", "result", "log"), tasks)
