"""The report's task, planned when all others have ended; and its files put into ``summary``."""

import shutil
from pathlib import Path
from typing import Any

from millfrf.core import writing_whole_file

from ..graph import ALL, RecordingSet, Task, key_of
from ..running import State, folder_of, program_digest, read_outcome
from .opened import OpenedCampaign

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
