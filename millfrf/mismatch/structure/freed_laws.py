"""An answer whose laws are given a free form where held-out data ask for it, in words and in its improved model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..inference.diagnosis import AcceptedCause
from ..inference.search import Proposal
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..records.held_out_parts import Recordings
from ..residual.structured_residual import leftover
from .acceptance import impossible, possible_gains
from .answer import Answer
from .comparison import StructureComparison
from .freed_laws_proved import Beginning, FreedLaws, freed_from_named, freed_from_nothing
from .rounds import likeliest_seen


@dataclass(frozen=True)
class FreedAnswer:
    """An answer, and the laws of free form with which it predicts.

    Parameters
    ----------
    answer
        The answer; its final fit and its errors are those of the free form where there is one.
    freed
        Laws of free form; None where held-out data ask for none.
    sentence
        What the free form says; empty where there is none.
    doubt
        Why the answer is no longer whole; empty where it stands.
    """

    answer: Answer
    freed: FreedLaws | None = None
    sentence: str = ""
    doubt: str = ""

    @property
    def textbook(self) -> Hypothesis | None:
        """The hypothesis with laws as the library has them; None where no law was given a free form."""
        return None if self.freed is None else self.freed.begun

    def content(self) -> dict[str, Any] | None:
        """What the file of a diagnosis says of it; None where there is no free form."""
        return None if self.freed is None else {**self.freed.content(), "sentence": self.sentence}


def freed_answer(
    answer: Answer, comparison: StructureComparison, recordings: Recordings, faults: Sequence[AcceptedCause]
) -> FreedAnswer:
    """Give the laws of an answer a free form; where no law was proved, the likeliest one.

    A named law keeps its name. Where a free form of it leaves far less, the name is not the whole: ``explained``
    becomes ``partly explained``. Where no law was proved, the verdict stays ``unexplained`` and no name is told, but
    the force is, by what it follows, and the improved model predicts with it.

    Parameters
    ----------
    answer
        The answer with textbook laws, or with none.
    comparison
        The comparison that was searched.
    recordings
        The recordings, mended and as measured.
    faults
        Faults of the recordings that are told.
    """
    settings, base = comparison.settings, answer.found.base
    if answer.verdict == "unexplained":
        starts = [
            Beginning(one.fitted, base, answer.held_out, (one.location,)) for one in _likely_laws(answer, comparison)
        ]
        tried = [freed_from_nothing(recordings, one, faults, settings) for one in starts]
        found = min((one for one in tried if one is not None), key=lambda one: one.fitted.score, default=None)
        return (
            FreedAnswer(answer) if found is None else FreedAnswer(_with(answer, found, recordings), found, _new(found))
        )
    places = tuple(one.location for one in answer.found.accepted if one.fitted.hypothesis.causes[-1].axis is not None)
    freed = freed_from_named(recordings, Beginning(answer.final, base, answer.held_out, places), faults, settings)
    if freed is None:
        return FreedAnswer(answer)
    again, doubt = _with(answer, freed, recordings), ""
    if answer.verdict == "explained" and freed.ratio > settings.verdict.most_over_free:
        again = replace(again, verdict="partly explained")
        doubt = (
            f"the named law leaves {freed.ratio:.2g} times as much of what was held out as its free form; "
            "the law's name does not describe all of the force"
        )
    return FreedAnswer(again, freed, _beside(freed), doubt)


def _likely_laws(answer: Answer, comparison: StructureComparison) -> list[Proposal[Fit]]:
    """Laws at which a free form may begin: the one that gained most alone, and the likeliest on the motion seen.

    Where the form of a law is wrong, its free simulation says little, and the seen motion still tells its family.
    """
    if not answer.found.rounds:
        return []
    first = answer.found.rounds[0]
    laws = [one for one in first.proposals if one.name in comparison.laws and np.isfinite(one.fitted.score)]
    alone = sorted((one for one in laws if len(one.fitted.hypothesis.causes) == 1), key=lambda one: -one.evidence)
    best = possible_gains(alone, comparison.settings.evidence)[:1]
    seen = likeliest_seen(first.candidates, comparison.laws)
    other = [one for one in alone if one.name == seen and all(one is not known for known in best)][:1]
    return [one for one in best + other if not impossible(one, comparison.settings.evidence)]


def _with(answer: Answer, freed: FreedLaws, recordings: Recordings) -> Answer:
    """The answer that predicts with the free form."""
    left = leftover(freed.fitted.hypothesis, recordings.mended)
    return replace(answer, final=freed.fitted, held_out=freed.held_out, left=left)


def _beside(freed: FreedLaws) -> str:
    """What the free form of named laws says."""
    parts = [
        f"the force of {name}{f' ({place})' if place else ''} differs from the textbook law by "
        f"{100 * form.distance:.2g} % of its size"
        for (name, place), form in zip(freed.names, freed.forms, strict=True)
    ]
    return f"Free form: {', and '.join(parts)}; {_errors(freed, 'the textbook law')}."


def _new(freed: FreedLaws) -> str:
    """What a free form says where no law was proved."""
    (name, place), form = freed.names[0], freed.forms[0]
    return (
        f"Free form: no law of the library is proved, but the force of a joint{f' ({place})' if place else ''} is: "
        f"{form.kind}. Begun at {name}, from which it differs by {100 * form.distance:.2g} % of its size, "
        f"{_errors(freed, 'a model of modes alone')}."
    )


def _errors(freed: FreedLaws, rival: str) -> str:
    """What the free form and its rival leave of what was held out."""
    after, before = freed.held_out.everywhere.after, freed.beside.after
    return (
        f"it leaves {100 * after:.3g} % of what was held out, {rival} {100 * before:.3g} % "
        f"(chance that this is no gain: {freed.chance:.2g}); the improved model holds it"
    )
