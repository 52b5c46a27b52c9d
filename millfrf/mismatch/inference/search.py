"""Forward search that adds significant causes one after the other, and processes in which tasks run in parallel."""

import multiprocessing
import os
import pickle
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.sharedctypes import Synchronized
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from millfrf.core import end_with

from .diagnosis import Candidate
from .settings import Settings
from .work import count_work, counted_work

Result = TypeVar("Result")


def in_processes(tasks: Sequence[Callable[[], Result]]) -> list[Result]:
    """Run independent tasks and return their results in the order of the tasks.

    On Linux and with more than one available core, the tasks run in forked processes. Otherwise, and if a result cannot
    be sent back, they run in this process one after the other.

    Parameters
    ----------
    tasks
        Functions without side effects whose results can be pickled.

    Raises
    ------
    Exception
        The exception of the first task that fails.
    """
    workers = min(_available_cores(), len(tasks))
    sent: dict[int, tuple[Result, int]] = _run_forked(tasks, workers) if workers > 1 else {}
    results: list[Result] = []
    for number, task in enumerate(tasks):
        # a task without a result runs again here, so that its exception has a traceback in this process
        result, work = sent[number] if number in sent else (task(), 0)
        count_work(work)
        results.append(result)
    return results


def _available_cores() -> int:
    """Return the number of usable cores; 1 if no process can be forked, or if this process was forked itself."""
    if not sys.platform.startswith("linux") or multiprocessing.parent_process() is not None:
        return 1
    return len(os.sched_getaffinity(0))


def _run_forked(tasks: Sequence[Callable[[], Result]], workers: int) -> dict[int, tuple[Result, int]]:
    """Return results and the work done for them by the task's number, without those of failed tasks."""
    context = multiprocessing.get_context("fork")
    next_task = context.Value("i", 0)
    readers: list[Connection] = []
    processes = []
    try:
        for _ in range(workers):
            reader, writer = context.Pipe(duplex=False)
            arguments = (tasks, next_task, writer, (*readers, reader), os.getpid())
            process = context.Process(target=_work, args=arguments, daemon=True)
            process.start()
            writer.close()
            readers.append(reader)
            processes.append(process)
        return _received(readers)
    except BaseException:
        # an interrupt reaches this process alone if it does not come from a terminal
        for process in processes:
            process.terminate()
        raise
    finally:
        for process in processes:
            process.join()


def _received(readers: list[Connection]) -> dict[int, Any]:
    """Collect results by the task's number until every process has closed its pipe."""
    results: dict[int, Any] = {}
    while readers:
        for reader in wait(readers):
            assert isinstance(reader, Connection)
            try:
                message = reader.recv_bytes()
            except (EOFError, OSError):
                # the process has ended, perhaps in the middle of a message
                readers.remove(reader)
                continue
            try:
                number, result = pickle.loads(message)
            except Exception:
                # the caller runs the task again
                continue
            results[number] = result
    return results


def _work(
    tasks: Sequence[Callable[[], Any]],
    next_task: "Synchronized[int]",
    writer: Connection,
    inherited: Sequence[Connection],
    parent: int,
) -> None:
    """Run the next task until none remains, in a process that ends with the process ``parent``."""
    end_with(parent)
    # an interrupt ends this process without a traceback: the parent reports it
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    # an inherited reader that stays open would block the writes of a sibling after the parent has closed it
    for reader in inherited:
        reader.close()
    while True:
        with next_task.get_lock():
            number = next_task.value
            next_task.value += 1
        if number >= len(tasks):
            return
        try:
            with counted_work() as work:
                result = tasks[number]()
            writer.send((number, (result, work.values)))
        except Exception:
            # the caller runs the task again and raises its exception
            continue


Progress = Callable[[str], None]


class Fitted(Protocol):
    """Fitted hypothesis, with the attribute that the search needs."""

    @property
    def score(self) -> float:
        """Score ``misfit + deviation + price``: Bayes' information criterion with the prior; lower is better."""
        ...


Fit = TypeVar("Fit", bound=Fitted)


@dataclass(frozen=True)
class Proposal(Generic[Fit]):
    """A fitted hypothesis with one more cause."""

    name: str
    location: Mapping[str, Any]  # place of the cause, as a diagnosis states it
    fitted: Fit  # fit of the hypothesis with the cause
    evidence: float  # gain in score over the hypothesis without the cause


@dataclass(frozen=True)
class Round(Generic[Fit]):
    """One round of the search."""

    proposals: tuple[Proposal[Fit], ...]  # causes that were fitted together with the accepted ones
    chosen: Proposal[Fit] | None  # the accepted cause; None ends the search
    candidates: tuple[Candidate, ...]  # all causes of the round, screened or fitted
    equivalents: tuple[str, ...] = ()  # names of causes that the data cannot distinguish from the chosen one


@dataclass(frozen=True)
class Search(Generic[Fit]):
    """State of a search."""

    steps: tuple[Fit, ...]  # fits without causes, with the first cause, with the first two, and so on
    accepted: tuple[Proposal[Fit], ...] = ()  # proposals that lead from one step to the next
    rounds: tuple[Round[Fit], ...] = ()
    rejected: tuple[Candidate, ...] = field(default_factory=tuple)

    @property
    def base(self) -> Fit:
        """Fit without causes."""
        return self.steps[0]

    @property
    def current(self) -> Fit:
        """Fit with all accepted causes."""
        return self.steps[-1]

    @property
    def equivalents(self) -> tuple[str, ...]:
        """Equivalents of the first accepted cause that has any, without causes that were accepted themselves."""
        names = {proposal.name for proposal in self.accepted}
        for round_ in self.rounds:
            # equivalents of a cause that was rejected later do not count
            if any(proposal is round_.chosen for proposal in self.accepted):
                others = tuple(name for name in round_.equivalents if name not in names)
                if others:
                    return others
        return ()

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Candidates of all rounds and causes that were rejected later; most evidence first."""
        considered = [candidate for round_ in self.rounds for candidate in round_.candidates]
        return tuple(sorted([*considered, *self.rejected], key=lambda candidate: -candidate.evidence))


class Comparison(Protocol[Fit]):
    """Comparison of one kind of model with recordings."""

    @property
    def settings(self) -> Settings:
        """Thresholds of this comparison."""
        ...

    def finished(self, search: Search[Fit]) -> bool:
        """Return whether the residual needs no further cause."""
        ...

    def round(self, search: Search[Fit]) -> Round[Fit]:
        """Screen and fit causes that may be added to the last step, and choose a significant one."""
        ...

    def without(self, search: Search[Fit], place: int) -> Fit:
        """Fit the last step without the accepted cause ``search.accepted[place]``."""
        ...

    def needed(self, current: Fit, base: Fit) -> float:
        """Return the evidence that a further cause needs if the causes of ``current`` are accepted."""
        ...


@runtime_checkable
class IndependenceTest(Protocol[Fit]):
    """Comparison that distinguishes small independent causes from causes that only correct the form of others."""

    def is_independent(self, search: Search[Fit], place: int, less: Fit) -> bool:
        """Return whether ``search.accepted[place]`` is kept although it is small; ``less`` is the fit without it."""
        ...


def best_first(proposals: Sequence[Proposal[Fit]]) -> tuple[Proposal[Fit], ...]:
    """Sort proposals by their evidence, most first."""
    return tuple(sorted(proposals, key=lambda proposal: -proposal.evidence))


def equivalents_of(proposals: Sequence[Proposal[Fit]], chosen: Proposal[Fit], as_good: float) -> tuple[str, ...]:
    """Return the names of causes whose evidence is less than ``as_good`` below the chosen cause's, each name once."""
    limit = chosen.evidence - as_good
    near = [other.name for other in proposals if other.name != chosen.name and other.evidence > limit]
    return tuple(dict.fromkeys(near))


def search(comparison: Comparison[Fit], base: Fit, progress: Progress) -> Search[Fit]:
    """Add significant causes to the fit ``base`` without causes (forward selection), then remove redundant ones."""
    return continued(comparison, Search((base,)), progress)


def continued(comparison: Comparison[Fit], state: Search[Fit], progress: Progress) -> Search[Fit]:
    """Add further significant causes to those of a search, then remove redundant ones."""
    while len(state.accepted) < comparison.settings.search.most_causes and not comparison.finished(state):
        progress(f"causes, round {len(state.steps)}")
        round_ = comparison.round(state)
        state = replace(state, rounds=(*state.rounds, round_))
        if round_.chosen is None:
            break
        state = replace(state, steps=(*state.steps, round_.chosen.fitted), accepted=(*state.accepted, round_.chosen))
    progress("redundant causes")
    return pruned(comparison, state)


def pruned(comparison: Comparison[Fit], state: Search[Fit]) -> Search[Fit]:
    """Remove causes that later ones have made redundant (backward elimination).

    For instance, a mode that imitates a joint may be accepted before the joint is. A cause is removed if the fit
    without it loses less than the evidence that a cause needs, unless the comparison shows that the cause is
    independent. The last cause is also tested, as a part of its gain may be due to incomplete convergence of the fit
    before.
    """
    for place in range(len(state.accepted) - 1, -1, -1):
        if len(state.accepted) < 2:
            break
        less = comparison.without(state, place)
        loss = less.score - state.current.score
        redundant = loss < comparison.needed(less, state.base)
        if redundant and isinstance(comparison, IndependenceTest):
            redundant = not comparison.is_independent(state, place, less)
        if redundant:
            state = without_cause(state, place, less, "rejected", loss)
    return state


def without_cause(state: Search[Fit], place: int, less: Fit, stage: str, evidence: float) -> Search[Fit]:
    """Reject one of the accepted causes.

    ``less`` is the last step without the cause, ``stage`` the reason that its candidate states, and ``evidence`` the
    score that the last step loses.
    """
    gone = state.accepted[place]
    if place == len(state.accepted) - 1:
        steps = (*state.steps[:place], less) if place else state.steps[:1]
    else:
        steps = (*state.steps[: place + 1], *state.steps[place + 2 : -1], less)
    return replace(
        state,
        steps=steps,
        accepted=(*state.accepted[:place], *state.accepted[place + 1 :]),
        rejected=(*state.rejected, Candidate(gone.name, evidence, stage, dict(gone.location))),
    )


def without_causes(state: Search[Fit], stage: str) -> Search[Fit]:
    """Reject all accepted causes; ``stage`` is the reason that their candidates state."""
    gone = tuple(
        Candidate(proposal.name, proposal.evidence, stage, dict(proposal.location)) for proposal in state.accepted
    )
    return replace(state, steps=state.steps[:1], accepted=(), rejected=(*state.rejected, *gone))
