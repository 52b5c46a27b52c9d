"""Forward search for causes: one after the other while each is significant, then without redundant ones."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from .diagnosis import Candidate
from .settings import Settings


class Fitted(Protocol):
    """What the inference reads of a fitted hypothesis."""

    @property
    def score(self) -> float:
        """``misfit + deviation + price``: Bayes' information criterion with the belief as prior; less is better."""
        ...


Fit = TypeVar("Fit", bound=Fitted)


@dataclass(frozen=True)
class Proposal(Generic[Fit]):
    """A hypothesis with one more cause, fitted.

    Parameters
    ----------
    name
        Name of the cause, as it is told.
    location
        Where it sits, as a diagnosis states it.
    fitted
        The whole hypothesis with the cause.
    evidence
        Gain in score over the hypothesis without it.
    """

    name: str
    location: Mapping[str, Any]
    fitted: Fit
    evidence: float


@dataclass(frozen=True)
class Round(Generic[Fit]):
    """One round of the search.

    Parameters
    ----------
    proposals
        Causes that were fitted beside those accepted before.
    chosen
        The one that is accepted; None ends the search.
    candidates
        All causes that were weighed, screened or fitted, as a diagnosis tells them.
    equivalents
        Names of causes that the data cannot tell from the chosen one.
    """

    proposals: tuple[Proposal[Fit], ...]
    chosen: Proposal[Fit] | None
    candidates: tuple[Candidate, ...]
    equivalents: tuple[str, ...] = ()


@dataclass(frozen=True)
class Search(Generic[Fit]):
    """Where a search stands, or ends.

    Parameters
    ----------
    steps
        Fits without any cause, with the first, and so on.
    accepted
        The proposals that lead from one step to the next.
    rounds
        What was weighed in each round.
    rejected
        Causes that were accepted once and let go again.
    """

    steps: tuple[Fit, ...]
    accepted: tuple[Proposal[Fit], ...] = ()
    rounds: tuple[Round[Fit], ...] = ()
    rejected: tuple[Candidate, ...] = field(default_factory=tuple)

    @property
    def base(self) -> Fit:
        """The fit without any cause."""
        return self.steps[0]

    @property
    def current(self) -> Fit:
        """The fit with all accepted causes."""
        return self.steps[-1]

    @property
    def equivalents(self) -> tuple[str, ...]:
        """Names that the data cannot tell from an accepted cause: those of the first one that has any.

        Those of a cause that was let go, and those that were accepted themselves, are not among them.
        """
        names = {one.name for one in self.accepted}
        for one in self.rounds:
            if any(kept is one.chosen for kept in self.accepted):
                others = tuple(name for name in one.equivalents if name not in names)
                if others:
                    return others
        return ()

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All causes that were weighed in any round, and those let go again; most evidence first."""
        weighed = [candidate for one in self.rounds for candidate in one.candidates]
        return tuple(sorted([*weighed, *self.rejected], key=lambda one: -one.evidence))


class Comparison(Protocol[Fit]):
    """One kind of comparison of a model with recordings."""

    @property
    def settings(self) -> Settings:
        """Thresholds of this comparison."""
        ...

    def finished(self, search: Search[Fit]) -> bool:
        """Whether what is left needs no further cause."""
        ...

    def round(self, search: Search[Fit]) -> Round[Fit]:
        """Screen and fit the causes that may be added to the last step, and choose the one that is worth it."""
        ...

    def without(self, search: Search[Fit], place: int) -> Fit:
        """The last step fitted without one of its accepted causes, ``search.accepted[place]``."""
        ...

    def needed(self, current: Fit, base: Fit) -> float:
        """Evidence that a further cause needs beside the causes of ``current``."""
        ...


@runtime_checkable
class SureComparison(Protocol[Fit]):
    """A comparison that knows whether a small cause is one of its own, or mends what the others leave undone."""

    def is_of_its_own(self, search: Search[Fit], place: int, less: Fit) -> bool:
        """Whether ``search.accepted[place]`` stays however small it is; ``less`` is the last step without it."""
        ...


def best_first(proposals: Sequence[Proposal[Fit]]) -> tuple[Proposal[Fit], ...]:
    """Proposals in the order of their evidence, most first.

    Parameters
    ----------
    proposals
        Fitted causes of one round.
    """
    return tuple(sorted(proposals, key=lambda one: -one.evidence))


def equivalents_of(proposals: Sequence[Proposal[Fit]], chosen: Proposal[Fit], as_good: float) -> tuple[str, ...]:
    """Names of causes that explain as well as the chosen one, each once.

    Parameters
    ----------
    proposals
        Fitted causes of the round.
    chosen
        The accepted one.
    as_good
        Evidence by which another may be worse.
    """
    near = [one.name for one in proposals if one.name != chosen.name and one.evidence > chosen.evidence - as_good]
    return tuple(dict.fromkeys(near))


Progress = Callable[[str], None]


@dataclass(frozen=True)
class Patience:
    """A clock that says when a search has lasted long enough.

    What is under way is ended; nothing new is begun. Forked processes see the same clock.

    Parameters
    ----------
    seconds
        How long the search may last, s; without it for ever.
    begun
        When it began, on the clock of ``time.monotonic``, s.

    Examples
    --------
    >>> Patience(60.0).over, Patience(0.0).over
    (False, True)
    """

    seconds: float = float("inf")
    begun: float = field(default_factory=time.monotonic)

    @property
    def over(self) -> bool:
        """Whether the time has passed."""
        return time.monotonic() - self.begun >= self.seconds


def search(comparison: Comparison[Fit], base: Fit, progress: Progress) -> Search[Fit]:
    """Add causes to a hypothesis as long as one is worth it (forward selection), then prune.

    Parameters
    ----------
    comparison
        How causes are proposed, fitted and judged.
    base
        The fit without any cause.
    progress
        Called with a short text when a new stage begins.
    """
    found = Search((base,))
    while len(found.accepted) < comparison.settings.search.most_causes and not comparison.finished(found):
        progress(f"causes, round {len(found.steps)}")
        one = comparison.round(found)
        found = replace(found, rounds=(*found.rounds, one))
        if one.chosen is None:
            break
        found = replace(found, steps=(*found.steps, one.chosen.fitted), accepted=(*found.accepted, one.chosen))
    progress("causes made needless")
    return pruned(comparison, found)


def pruned(comparison: Comparison[Fit], found: Search[Fit]) -> Search[Fit]:
    """Let go of causes that later ones have made needless (backward elimination).

    What one cause leaves may look like another: a mode that imitates a joint is found before the joint is. Each cause
    is taken away; if the fit without it loses less than the evidence a cause needs, it stays away, unless the
    comparison knows that it mends nothing of the others. The last one, too: it may have gained what the fit before it
    had left undone.

    Parameters
    ----------
    comparison
        How the fit without a cause is made.
    found
        The search where it ended.
    """
    for place in range(len(found.accepted) - 1, -1, -1):
        if len(found.accepted) < 2:
            break
        less = comparison.without(found, place)
        loss = less.score - found.current.score
        if loss < comparison.needed(less, found.base) and not _stands(comparison, found, place, less):
            found = released(found, place, less, "rejected", loss)
    return found


def _stands(comparison: Comparison[Fit], found: Search[Fit], place: int, less: Fit) -> bool:
    """Whether a cause stays although it loses little, as it is one of its own."""
    return isinstance(comparison, SureComparison) and comparison.is_of_its_own(found, place, less)


def released(found: Search[Fit], place: int, less: Fit, stage: str, evidence: float) -> Search[Fit]:
    """A search without one of its accepted causes.

    Parameters
    ----------
    found
        The search with the cause.
    place
        Which of the accepted causes goes.
    less
        The last step without it.
    stage
        Why it goes, as its candidate says.
    evidence
        Score that the last step loses.
    """
    gone = found.accepted[place]
    if place == len(found.accepted) - 1:
        steps = (*found.steps[:place], less) if place else found.steps[:1]
    else:
        steps = (*found.steps[: place + 1], *found.steps[place + 2 : -1], less)
    return replace(
        found,
        steps=steps,
        accepted=(*found.accepted[:place], *found.accepted[place + 1 :]),
        rejected=(*found.rejected, Candidate(gone.name, evidence, stage, dict(gone.location))),
    )


def emptied(found: Search[Fit], stage: str) -> Search[Fit]:
    """A search that let go of all its causes.

    Parameters
    ----------
    found
        The search with causes.
    stage
        Why they go, as their candidates say.
    """
    gone = tuple(Candidate(one.name, one.evidence, stage, dict(one.location)) for one in found.accepted)
    return replace(found, steps=found.steps[:1], accepted=(), rejected=(*found.rejected, *gone))
