"""The step from a campaign file to its results."""

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge

from millfrf.core import DiskFull, InputError
from millfrf.core.steps import File, Reads, Typed, Writes, step
from millfrf.core.terminal import Table, manner, say, show, tell, warn
from millfrf.steps.answers import tables_answer

from .on_dask import dask_executor
from .opened import OpenedCampaign, graph_table, open_campaign, time_lines
from .progress import ProgressLines, measured_rates, note_time
from .recordings import keep
from .run_folder import (
    FAILURES,
    SUMMARY,
    doubt_rows,
    failure_rows,
    only_run,
    program_changed,
    publish,
    recording_lines,
    report_key,
    report_task,
    root_lines,
    write_lists,
)
from .running import Ended, Executor, InThisProcess, State, left_to_run, run_tasks
from .store import forget, read_outcome


@step
def campaign(
    campaign: Annotated[File, Reads("CAMPAIGN.toml")],
    /,
    *,
    scheduler: Annotated[str, Typed("ADDRESS")] | None = None,
    workers: Annotated[int, Ge(0)] | None = None,
    dry_run: bool = False,
    out: Annotated[File | None, Writes("DIR")] = None,
    retry: bool = False,
) -> "RunSummary | None":
    """Estimate, fit, calibrate, lobes, diagnose, learn and report over hundreds of recordings, on any number of cores.

    Results are kept by the content of their inputs: a second run computes only what is new or was left. What fails is
    listed with its reason and hides nothing else; exit code 1 says that tasks are left which the next run tries again.

    Parameters
    ----------
    campaign
        Campaign file: recordings, and the jobs to do.
    scheduler
        Dask scheduler; without it this machine does the work.
    workers
        Worker processes of this machine; 0 is none, without Dask.
    dry_run
        Show the graph and its time; compute nothing.
    out
        Folder of results; without it CAMPAIGN_results in the folder of the file.
    retry
        Try again what was refused.

    Returns
    -------
    RunSummary or None
        What became of the run; None for a dry run.

    Raises
    ------
    InputError
        A file, an option or a cluster that cannot be used.
    MillfrfError
        The scheduler is gone.

    Examples
    --------
    ::

        $ millfrf campaign campaign.toml --workers 2 --out results
    """
    path = Path(campaign)
    folder = path.with_name(f"{path.stem}_results") if out is None else Path(out)
    options = RunOptions(folder, scheduler, workers, retry)
    if dry_run:
        table, lines = dry_run_lines(path, options)
        tell(lambda: {"tasks": tables_answer([table]), "lines": lines})
        show(table)
        for line in lines:
            say(line)
        return None
    found = run_campaign(path, options)
    tell(lambda: {"tasks_run": found.ran, "tasks_settled": found.state.settled, "failures": found.failures})
    for line in found.failures:
        say(f"failed: {line}")
    warn(found.doubts)
    for line in found.lines():
        say(line)
    if found.state.failed or found.state.full:
        manner().exit_code = TASKS_LEFT
    return found


TASKS_LEFT = 1
"""Exit code where tasks are left that the next run tries again."""


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Parameters
    ----------
    out
        Folder of results.
    scheduler
        Address of a Dask scheduler; None: worker processes of this machine.
    workers
        Number of these; 0: in this process, without Dask. None: one a core.
    retry
        Whether what was refused before is tried again.
    """

    out: Path
    scheduler: str | None = None
    workers: int | None = None
    retry: bool = False


@dataclass(frozen=True)
class RunSummary:
    """What became of a run.

    Parameters
    ----------
    opened
        Campaign that was opened: files, tasks, keys.
    state
        What became of its tasks.
    ran
        Number of tasks that were run now.
    failures
        One line for each failure that is not only the consequence of another.
    doubts
        One line for each doubt about a recording by itself.
    summary
        Folder of tables and report, or None.
    """

    opened: OpenedCampaign
    state: State
    ran: int
    failures: tuple[str, ...]
    doubts: tuple[str, ...]
    summary: Path | None

    def lines(self) -> list[str]:
        """How the run ended, in a few lines."""
        counts = Counter(self.state.settled.values())
        opened, failed = self.opened, self.state.failed
        lines = [
            f"{self.ran} tasks run now; {counts['done']} done, {counts['refused']} refused, {len(failed)} left for the "
            f"next run ({opened.out / FAILURES})"
        ]
        if self.state.full:
            lines.append(f"{self.state.full}; free space, then run the same command again")
        if self.summary is not None:
            lines.append(f"wrote {self.summary}: {', '.join(sorted(one.name for one in self.summary.iterdir()))}")
        return lines


def dry_run_lines(path: Path, options: RunOptions) -> tuple[Table, list[str]]:
    """The graph as a table, and lines on the time that it takes; nothing is computed or written.

    Raises
    ------
    InputError
        As :func:`open_campaign`.
    """
    opened = open_campaign(path, options.out.resolve(), hashing=False)
    settled = _settled(opened)
    rates = measured_rates(opened.out)
    workers = max(1, cores() if options.workers is None else options.workers)
    lines = [*time_lines(opened, settled, rates, workers), *opened.plan.left_out]
    if program_changed(opened.out):
        lines.append("millfrf or a library that computes has changed since the last run: all results are made anew")
    return graph_table(opened, settled, rates), lines


def run_campaign(path: Path, options: RunOptions) -> RunSummary:
    """Run all tasks of a campaign whose results are not in the store, and write the report.

    Raises
    ------
    InputError
        A file, an option or a cluster that cannot be used.
    MillfrfError
        The scheduler is gone.
    """
    _check(options)
    out = options.out.resolve()
    with only_run(out):
        opened = open_campaign(path, out, hashing=True)
        keep(out, opened.kept)
        state = State(settled=_settled(opened))
        if options.retry:
            _forget_refused(opened, state)
        left = left_to_run(opened.plan.tasks, state.settled)
        with _executor(opened, options, bool(left)) as executor:
            ended = _run(opened, state, executor) if left else 0
            rows = failure_rows(opened, state)
            failures = [*root_lines(rows), *opened.plan.left_out]
            doubts = doubt_rows(opened, state)
            ran, summary, refusal = _report(opened, state, executor, [*failures, *recording_lines(doubts)])
            failures += [f"report: {refusal}"] if refusal else []
        try:
            write_lists(opened, state, rows, doubts)
        except DiskFull as error:
            state.full = state.full or str(error)
    return RunSummary(opened, state, ended + ran, tuple(failures), tuple(recording_lines(doubts)), summary)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check(options: RunOptions) -> None:
    if options.workers is not None and options.workers < 0:
        raise InputError(f"--workers {options.workers}: give 1 or more, or 0 to run in this process")
    if options.scheduler is not None and options.workers is not None:
        raise InputError("--workers are those of a cluster on this machine; a scheduler has its own: leave one out")


def _settled(opened: OpenedCampaign) -> dict[str, str]:
    """Status of each task whose result is in the store."""
    found = {}
    for identity, key in opened.keys.items():
        outcome = None if key is None else read_outcome(opened.out, identity, key)
        if outcome is not None:
            found[identity] = "done" if outcome.done else "refused"
    return found


def _forget_refused(opened: OpenedCampaign, state: State) -> None:
    """Take refusals, and all that hangs on them, out of the store."""
    gone: set[str] = set()
    for identity, task in opened.plan.tasks.items():
        if state.settled.get(identity) == "refused" or gone.intersection(task.needs):
            gone.add(identity)
            if state.settled.pop(identity, None) is not None:
                forget(opened.out, identity, opened.keys[identity] or "")


@contextmanager
def _executor(opened: OpenedCampaign, options: RunOptions, needed: bool) -> Iterator[Executor]:
    """Where tasks run; without tasks no cluster is made."""
    workers = cores() if options.workers is None else options.workers
    if not needed or (options.scheduler is None and workers == 0):
        yield InThisProcess()
        return
    with dask_executor(options.scheduler, workers, opened.out, opened.recordings[0].path) as executor:
        yield executor


def _run(opened: OpenedCampaign, state: State, executor: Executor) -> int:
    """Run what is left, and tell of it; number of tasks that ended."""
    tasks = opened.plan.tasks
    left, rates = left_to_run(tasks, state.settled), measured_rates(opened.out)
    expected = {one: rates.seconds(tasks[one], opened.megabytes(tasks[one])) for one in left}
    lines = ProgressLines(expected, rates.measured)

    def told(ended: Ended | None) -> None:
        if ended is not None:
            note_time(opened.out, ended, opened.megabytes(tasks[ended.identity]))
            lines.ended(ended)
        lines.show(executor.n_workers)

    try:
        run_tasks(tasks, state, opened.order, executor, told)
    finally:
        lines.stop()
    return lines.done


def _report(opened: OpenedCampaign, state: State, executor: Executor, lines: list[str]) -> tuple[int, Path | None, str]:
    """Write the report where it is asked for: tasks run for it (0: it was there), its folder, why there is none."""
    if opened.file.report is None or state.full:
        return 0, None, ""
    task = report_task(opened, state, lines)
    key = report_key(opened, task)
    ran = read_outcome(opened.out, task.identity, key) is None
    if ran:
        keys = {**opened.keys, task.identity: key}
        only = State(settled=dict(state.settled))
        run_tasks({task.identity: task}, only, lambda _: opened.order_of(task, keys), executor, lambda _: None)
        state.failed.update(only.failed)
        state.full = only.full
    found = read_outcome(opened.out, task.identity, key)
    if found is None:
        return int(ran), None, state.failed.get(task.identity, "")
    state.settled[task.identity] = "done" if found.done else "refused"
    if not found.done:
        return int(ran), None, found.reason
    publish(opened.out, key)
    return int(ran), opened.out / SUMMARY, ""
