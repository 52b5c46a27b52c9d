"""Lists beside the results: what failed and why, and which folder holds the result of which task."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from millfrf.core import writing_whole_file

from ..running import State, folder_of, log_of, read_outcome
from .opened import OpenedCampaign
from .report_task import reason_of

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
