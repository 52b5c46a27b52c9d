"""The last fit of an answer: every recording counts alike in it, where that predicts better what was held out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....inference import AcceptedCause, ProofSettings
from ....models import even_fit
from ....records import Recordings
from ....remainder import leftover
from ..answer import Answer
from ..held_out import HeldOut, scored

STEPS = 20
"""Steps at most of the last fit."""

BEYOND_NOISE = 1.5
"""Error held out, over the noise, from which more than noise is left: below it no fit is better than the likeliest."""


@dataclass(frozen=True)
class LastFit:
    """An answer whose improved model is fitted last with every recording counted alike, or as it was.

    Parameters
    ----------
    answer
        The answer that predicts.
    sentence
        What the last fit brings, in words; empty where it was not taken.
    """

    answer: Answer
    sentence: str = ""


def last_fit(
    answer: Answer, recordings: Recordings, faults: Sequence[AcceptedCause], settings: ProofSettings
) -> LastFit:
    """Fit the laws of an answer once more by shares of the response, and keep that if it predicts better.

    Names, numbers and errors that are told stay those of the likelihood. The fit is kept where it lowers both errors
    held out: the one that is told, and that of all recordings together.

    Parameters
    ----------
    answer
        The answer with textbook laws or with free forms.
    recordings
        The recordings, mended and as measured.
    faults
        Faults of the recordings that are told.
    settings
        Thresholds of the proof on held-out blocks.
    """
    before, final = answer.held_out, answer.final
    gain = before.improvement
    if not final.hypothesis.laws or not recordings.tested or gain.after < BEYOND_NOISE * gain.noise_floor:
        return LastFit(answer)
    begun = replace(final, hypothesis=before.improved, noises=())
    elsewhere = even_fit(recordings.others(recordings.mended), begun, iterations=STEPS)
    if not np.isfinite(elsewhere.score):
        return LastFit(answer)
    there = scored(recordings, (before.linear, elsewhere.hypothesis), final.noises, faults, settings)
    if not there.leaves_less_than(before):
        return LastFit(answer)
    again = even_fit(recordings.mended, final, iterations=STEPS)
    if not np.isfinite(again.score):
        return LastFit(answer)
    left = leftover(again.hypothesis, recordings.mended)
    return LastFit(replace(answer, final=again, held_out=there, left=left), _in_words(before, there))


def _in_words(before: HeldOut, there: HeldOut) -> str:
    """What the last fit brings."""
    old, new = (100 * one.everywhere.after for one in (before, there))
    return (
        "The improved model is fitted last by least squares in which every recording counts alike: of what was held "
        f"out in all of them it leaves {new:.3g} % instead of {old:.3g} %. Its numbers differ from those that are told."
    )
