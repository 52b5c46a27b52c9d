"""The search for causes: one after the other while each is worth it and time is left, then without needless ones."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from .comparison import Comparison, Fit, Search, SureComparison
from .diagnosis import Candidate

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
