"""The dry run: the graph by kinds, what is done already, and how long the rest takes."""

from collections import Counter
from collections.abc import Mapping

from ...tables import Table
from ..graph import Task
from ..running import Rates, left_to_run, shown_time
from .opened import OpenedCampaign


def graph_table(opened: OpenedCampaign, settled: Mapping[str, str], rates: Rates) -> Table:
    """A row for each kind of task: how many, how many are in the store, what it needs, and its time."""
    tasks = opened.plan.tasks
    left = set(left_to_run(tasks, settled))
    kinds = Counter(task.kind for task in tasks.values())
    needs: dict[str, set[str]] = {kind: set() for kind in kinds}
    seconds = dict.fromkeys(kinds, 0.0)
    for identity, task in tasks.items():
        needs[task.kind].update(need.partition(":")[0] for need in task.needs)
        if identity in left:
            seconds[task.kind] += rates.seconds(task, opened.megabytes(task))
    rows = [
        (
            kind,
            str(count),
            str(sum(task.kind == kind and identity in settled for identity, task in tasks.items())),
            ", ".join(sorted(needs[kind])) or "files",
            shown_time(seconds[kind]),
            "measured here" if kind in rates.measured else "default",
        )
        for kind, count in kinds.items()
    ]
    columns = ("task", "number", "in the store", "needs", "time left, one core", "rate")
    return Table(f"Graph of {opened.file.campaign.title}", columns, tuple(rows))


def time_lines(opened: OpenedCampaign, settled: Mapping[str, str], rates: Rates, workers: int) -> list[str]:
    """Number of tasks, how long they take together and on so many workers, and what is not known."""
    tasks = opened.plan.tasks
    left = left_to_run(tasks, settled)
    each = {identity: rates.seconds(tasks[identity], opened.megabytes(tasks[identity])) for identity in left}
    total, chain = sum(each.values()), longest_chain(tasks, each)
    lines = [
        f"{len(opened.recordings)} recordings, {len(opened.plan.sets)} sets, {len(tasks)} tasks and the report; "
        f"{len(left)} to run",
        f"about {shown_time(max(total / workers, chain))} on {workers} worker{'s' if workers != 1 else ''} "
        f"({shown_time(total)} on one; the longest chain of tasks takes {shown_time(chain)})",
    ]
    guessed = sorted({tasks[one].kind for one in left} - rates.measured)
    if guessed and left:
        lines.append(
            f"default rates, which may be off by a factor of 5, for {', '.join(guessed)}; a run of this campaign "
            "measures its own"
        )
    unknown = sum(not look.digest for look in opened.looks.values())
    if unknown:
        lines.append(f"{unknown} files are new or changed since they were hashed: their tasks count as not done")
    return lines


def longest_chain(tasks: Mapping[str, Task], seconds: Mapping[str, float]) -> float:
    """Time of the longest chain of tasks each of which needs the one before, s."""
    until: dict[str, float] = {}
    for identity, task in tasks.items():
        until[identity] = seconds.get(identity, 0.0) + max((until[need] for need in task.needs), default=0.0)
    return max(until.values(), default=0.0)
