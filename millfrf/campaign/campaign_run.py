"""The step from a campaign file to its results."""

import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge

from millfrf.core import DiskError, InputError
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

    Results are stored by the content of their inputs, so a second run computes only what is new or unfinished. A failed
    task is listed with its reason and does not stop the others. Exit code 1: the next run will try some tasks again.

    Parameters
    ----------
    campaign
        Campaign file: recordings and jobs.
    scheduler
        Address of a Dask scheduler; without it the tasks run on this machine.
    workers
        Number of worker processes on this machine; 0 runs the tasks in this process, without Dask.
    dry_run
        Show the tasks and their expected time; compute nothing.
    out
        Folder of results; without it CAMPAIGN_results in the folder of the campaign file.
    retry
        Run refused tasks again.

    Returns
    -------
    RunSummary or None
        Outcome of the run; None for a dry run.

    Raises
    ------
    InputError
        A file, an option or a cluster cannot be used.
    MillfrfError
        The scheduler has stopped.

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
    summary = run_campaign(path, options)
    tell(lambda: {"tasks_run": summary.ran, "tasks_settled": summary.state.settled, "failures": summary.failures})
    for line in summary.failures:
        say(f"failed: {line}")
    warn(summary.doubts)
    for line in summary.lines():
        say(line)
    if summary.state.failed or summary.state.disk_error:
        manner().exit_code = TASKS_LEFT
    return summary


TASKS_LEFT = 1  # exit code if the next run will try some tasks again


@dataclass(frozen=True)
class RunOptions:
    """Options of a run."""

    out: Path  # folder of results
    scheduler: str | None = None  # address; None: worker processes on this machine
    workers: int | None = None  # worker processes; 0: in this process without Dask; None: one per core
    retry: bool = False  # run refused tasks again


@dataclass(frozen=True)
class RunSummary:
    """Outcome of a run."""

    opened: OpenedCampaign
    state: State
    ran: int  # number of tasks that this run has run
    failures: tuple[str, ...]  # one line each, without those that follow from another failure
    doubts: tuple[str, ...]  # one line for each warning about a single recording
    summary: Path | None  # folder of tables and report

    def lines(self) -> list[str]:
        """Describe the outcome in a few lines."""
        counts = Counter(self.state.settled.values())
        opened, failed = self.opened, self.state.failed
        lines = [
            f"{self.ran} tasks run now; {counts['done']} done, {counts['refused']} refused, {len(failed)} left for the "
            f"next run ({opened.out / FAILURES})"
        ]
        if self.state.disk_error:
            lines.append(f"{self.state.disk_error}; check the disk or free space, then run the same command again")
        if self.summary is not None:
            lines.append(f"wrote {self.summary}: {', '.join(sorted(file.name for file in self.summary.iterdir()))}")
        return lines


def dry_run_lines(path: Path, options: RunOptions) -> tuple[Table, list[str]]:
    """Return a table of the tasks and lines on their expected time; run no task and write no file."""
    opened = open_campaign(path, options.out.resolve(), hashing=False)
    settled = _settled(opened)
    rates = measured_rates(opened.out)
    workers = max(1, cores() if options.workers is None else options.workers)
    lines = [*time_lines(opened, settled, rates, workers), *opened.plan.left_out]
    if program_changed(opened.out):
        lines.append(
            "millfrf or a numerical library has changed since the last run: all results will be computed again"
        )
    return graph_table(opened, settled, rates), lines


def run_campaign(path: Path, options: RunOptions) -> RunSummary:
    """Run all tasks of a campaign whose results are not in the store, and write the report."""
    _check(options)
    out = options.out.resolve()
    with only_run(out):
        opened = open_campaign(path, out, hashing=True)
        keep(out, opened.kept)
        state = State(settled=_settled(opened))
        if options.retry:
            _forget_refused(opened, state)
        open_tasks = left_to_run(opened.plan.tasks, state.settled)
        with _executor(opened, options, bool(open_tasks)) as executor:
            n_ended = _run(opened, state, executor) if open_tasks else 0
            rows = failure_rows(opened, state)
            failures = [*root_lines(rows), *opened.plan.left_out]
            doubts = doubt_rows(opened, state)
            n_report, summary, refusal = _report(opened, state, executor, [*failures, *recording_lines(doubts)])
            failures += [f"report: {refusal}"] if refusal else []
        try:
            write_lists(opened, state, rows, doubts)
        except DiskError as error:
            state.disk_error = state.disk_error or str(error)
    return RunSummary(opened, state, n_ended + n_report, tuple(failures), tuple(recording_lines(doubts)), summary)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _check(options: RunOptions) -> None:
    if options.workers is not None and options.workers < 0:
        raise InputError(f"--workers {options.workers}: give 1 or more, or 0 to run in this process")
    if options.scheduler is not None and options.workers is not None:
        raise InputError(
            "--workers and --scheduler exclude each other: a scheduler has its own workers; give one of them"
        )


def _settled(opened: OpenedCampaign) -> dict[str, str]:
    """Return ``done`` or ``refused`` for each task whose result is stored, by the identity of the task."""
    status = {}
    for identity, key in opened.keys.items():
        outcome = None if key is None else read_outcome(opened.out, identity, key)
        if outcome is not None:
            status[identity] = "done" if outcome.done else "refused"
    return status


def _forget_refused(opened: OpenedCampaign, state: State) -> None:
    """Remove the results of refused tasks, and of all tasks that depend on them, from the store."""
    removed: set[str] = set()
    for identity, task in opened.plan.tasks.items():
        if state.settled.get(identity) == "refused" or removed.intersection(task.needs):
            removed.add(identity)
            if state.settled.pop(identity, None) is not None:
                forget(opened.out, identity, opened.keys[identity] or "")


@contextmanager
def _executor(opened: OpenedCampaign, options: RunOptions, needed: bool) -> Iterator[Executor]:
    """Open the executor of tasks; if no task is ``needed``, start no cluster, since a start takes seconds."""
    workers = cores() if options.workers is None else options.workers
    if not needed or (options.scheduler is None and workers == 0):
        yield InThisProcess()
        return
    with dask_executor(options.scheduler, workers, opened.out, opened.recordings[0].path) as executor:
        yield executor


def _run(opened: OpenedCampaign, state: State, executor: Executor) -> int:
    """Run the open tasks with progress; return the number of tasks that ended."""
    tasks = opened.plan.tasks
    open_tasks, rates = left_to_run(tasks, state.settled), measured_rates(opened.out)
    expected = {identity: rates.seconds(tasks[identity], opened.megabytes(tasks[identity])) for identity in open_tasks}
    lines = ProgressLines(expected, rates.measured)

    def report_end(ended: Ended | None) -> None:
        if ended is not None:
            note_time(opened.out, ended, opened.megabytes(tasks[ended.identity]))
            lines.ended(ended)
        lines.show(executor.n_workers)

    try:
        run_tasks(tasks, state, opened.order, executor, report_end)
    finally:
        lines.stop()
    return lines.done


def _report(opened: OpenedCampaign, state: State, executor: Executor, lines: list[str]) -> tuple[int, Path | None, str]:
    """Write the report if the campaign file asks for one.

    Return the number of tasks run, the folder of the report, and the reason why there is no report (empty: none).
    """
    if opened.file.report is None or state.disk_error:
        return 0, None, ""
    task = report_task(opened, state, lines)
    key = report_key(opened, task)
    is_new = read_outcome(opened.out, task.identity, key) is None
    if is_new:
        keys = {**opened.keys, task.identity: key}
        state_of_report = State(settled=dict(state.settled))
        run_tasks(
            {task.identity: task}, state_of_report, lambda _: opened.order_of(task, keys), executor, lambda _: None
        )
        state.failed.update(state_of_report.failed)
        state.disk_error = state_of_report.disk_error
    outcome = read_outcome(opened.out, task.identity, key)
    if outcome is None:
        return int(is_new), None, state.failed.get(task.identity, "")
    state.settled[task.identity] = "done" if outcome.done else "refused"
    if not outcome.done:
        return int(is_new), None, outcome.reason
    publish(opened.out, key)
    return int(is_new), opened.out / SUMMARY, ""
