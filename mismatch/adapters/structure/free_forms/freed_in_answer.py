"""An answer whose laws are given a free form where held-out data ask for it, in words and in its improved model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....inference import AcceptedCause, Proposal
from ....models import Fit, Hypothesis
from ....records import Recordings
from ....remainder import leftover
from ..acceptance import impossible, possible_gains
from ..answer import Answer
from ..comparison import StructureComparison
from ..form_errors import with_form_spread
from ..rounds import likeliest_seen
from ..told_causes import told_causes
from .freed_laws_proved import FreedLaws, freed_from_named, freed_from_nothing

NEARLY = "the law's textbook form leaves something that moves with the signal, and a form near it does not"
"""Why an answer is not whole whose law is known by a free form that hardly differs from it."""


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
    the force is, by what it follows, and the improved model predicts with it. Where that force hardly differs from a
    textbook law, and leaves nothing that moves with the signal, the law's name is told in part.

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
        return _of_unexplained(answer, comparison, recordings, faults)
    places = [one.location for one in answer.found.accepted if one.fitted.hypothesis.causes[-1].axis is not None]
    freed = freed_from_named(recordings, answer.final, answer.held_out, faults, settings, base=base, places=places)
    if freed is None:
        return FreedAnswer(answer)
    again, doubt = _with(answer, freed, recordings), ""
    if answer.verdict == "explained" and freed.ratio > settings.verdict.most_over_free:
        again = replace(again, verdict="partly explained")
        doubt = f"a force of free form leaves {1 / freed.ratio:.2g} of what the named law leaves: its name is not all"
    return FreedAnswer(again, freed, _beside(freed), doubt)


def _of_unexplained(
    answer: Answer, comparison: StructureComparison, recordings: Recordings, faults: Sequence[AcceptedCause]
) -> FreedAnswer:
    """A free form where no law was proved, and the law's name after all where the free form hardly differs from it."""
    settings = comparison.settings
    pairs = []
    for one in _likely_laws(answer, comparison):
        freed = freed_from_nothing(
            recordings,
            one.fitted,
            answer.held_out,
            faults,
            settings,
            base=answer.found.base,
            places=[one.location],
        )
        pairs += [] if freed is None else [(freed, one)]
    if not pairs:
        return FreedAnswer(answer)
    freed, begun = min(pairs, key=lambda pair: pair[0].fitted.score)
    again = _with(answer, freed, recordings)
    whole = again.left.noise_like(settings.verdict.noise_like)
    if not (whole and freed.of_one_family and freed.forms[0].distance <= settings.verdict.near_form):
        return FreedAnswer(again, freed, _new(freed))
    causes = told_causes(with_form_spread(begun.fitted, recordings.mended), [begun])
    again = replace(again, verdict="partly explained", causes=tuple(causes))
    return FreedAnswer(again, freed, _beside(freed), NEARLY)


def _likely_laws(answer: Answer, comparison: StructureComparison) -> list[Proposal[Fit]]:
    """Laws at which a free form may begin: the one that gained most alone, and the likeliest on the motion seen.

    What the free simulation makes of a law says little where its form is wrong; the seen motion knows its family.
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
