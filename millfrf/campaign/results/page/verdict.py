"""The verdict at the top of the report: drifts, sets that stand off, failures, in this order."""

from collections.abc import Sequence

from ..drift import Drifts, Outliers
from ..read_set import SetResults
from .drifts import deviations_by_set
from .trend_words import deviation_words, drift_words, pooled_words

MOST = 8
"""Sentences of each kind that stand in the verdict; the sections have all."""


def verdict_sentences(
    sets: Sequence[SetResults],
    drifts: Drifts,
    outliers: Outliers,
    more: Sequence[str],
    failed: Sequence[tuple[str, str]],
) -> list[str]:
    """Say what a reader wants first.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    drifts, outliers
        What drifts, and what stands off.
    more
        Further sentences on what stands off, such as poses that the posture model contradicts.
    failed
        Name of the set (empty: of the campaign) and reason of each failure.
    """
    usable = sum(one.model is not None for one in sets)
    told = [f"{usable} of {len(sets)} sets have a modal model."]
    told += _cut("Drift: ", _drift_sentences(drifts, sets)) or [
        "No drift was found." if drifts.count else "Nothing can be said of drift: no pose was measured twice."
    ]
    off = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    told += _cut("Stands off: ", [*off, *more]) or [
        "No set stands off the others of its pose."
        if outliers.count
        else "Nothing can be said of outlying sets: no pose has enough of them."
    ]
    told += _cut("Failed: ", [f"{name}: {line}" if name else line for name, line in failed]) or ["Nothing failed."]
    return told


def _drift_sentences(drifts: Drifts, sets: Sequence[SetResults]) -> list[str]:
    """Poses that drift while not all do, then what all poses share, and how many poses are like the others in it.

    Where all poses drift in a quantity, a pose is named that differs from the others; where they do not, each.
    """
    common = {(one.mode, one.quantity) for one in drifts.pooled}
    shown = [
        one for one in drifts.drifts if one.own or (one.trend.series.mode, one.trend.series.quantity) not in common
    ]
    alike = len(drifts.drifts) - len(shown)
    told = [drift_words(one, sets) for one in shown] + [pooled_words(one) for one in drifts.pooled]
    words = "1 trend of a single pose is" if alike == 1 else f"{alike} trends of single poses are"
    return [*told, *([f"{words} not told from what all poses do; the section lists them."] if alike else [])]


def _cut(start: str, sentences: Sequence[str]) -> list[str]:
    """The first sentences, and how many more there are."""
    shown = [f"{start}{sentence}" for sentence in sentences[:MOST]]
    more = len(sentences) - len(shown)
    return [*shown, *([f"... and {more} more below."] if more else [])]
