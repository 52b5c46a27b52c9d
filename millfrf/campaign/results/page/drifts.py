"""The sections on drift and on sets that stand off."""

from collections.abc import Sequence

import numpy as np

from ....report import Fold, Picture, Section
from ....tables import Table
from ..drift import Deviation, Drifts, Outliers, PooledTrend, Trend
from ..read_set import SetResults
from .trend_words import deviation_words, drift_words, label_words, mode_words, percent, pooled_words

MOST_ROWS = 40
"""Rows of a table of what was looked at; the least likely ones are shown."""


def drift_section(drifts: Drifts, sets: Sequence[SetResults], pictures: Sequence[Picture]) -> Section:
    """What drifts, with which label, and what would have been found.

    Parameters
    ----------
    drifts
        Trends that were looked at and found.
    sets
        Sets of the campaign, as read.
    pictures
        Pictures of the drifts.
    """
    if not drifts.count:
        why = (
            "No trend could be looked at: no label of number and no time varies inside a pose, or no pose has enough "
            "sets. Measure poses again, in another session."
        )
        return Section("Drift", (why,))
    sentences = [
        f"{drifts.count} trends were looked at: frequency and damping of each mode and the lowest depth limit, in each "
        "pose and over all poses, with each label of numbers. Named is what is more than chance among so many: without "
        "any drift, at most one campaign in twenty names one (false discovery rate below 5 %). ± is the 95 % interval, "
        "scatter between repeats included."
    ]
    sentences += [drift_words(one, sets) for one in drifts.drifts] + [pooled_words(one) for one in drifts.pooled]
    if not drifts.drifts and not drifts.pooled:
        sentences.append("No drift was found.")
    tables = [_smallest(drifts)] if drifts.smallest else []
    if drifts.suspects:
        tables.append(
            _trend_table("Worth another measurement: three standard errors alone, chance among so many", drifts)
        )
    folds = (Fold("Trends of all poses together", (_pooled_table(drifts.all_pooled),)),) if drifts.all_pooled else ()
    return Section("Drift", tuple(sentences), tuple(tables), tuple(pictures), folds)


def outlier_section(outliers: Outliers, sets: Sequence[SetResults], more: Sequence[str]) -> Section:
    """Sets that stand off the others of their pose, and what else contradicts.

    Parameters
    ----------
    outliers
        Deviations that were looked at and found.
    sets
        Sets of the campaign, as read.
    more
        Further sentences, such as recordings that disagree within a set.
    """
    sentences = [deviation_words(group, sets) for group in deviations_by_set(outliers)]
    if outliers.count and not sentences:
        sentences.append(f"None of {outliers.count} values stands off the other sets of its pose.")
    if not outliers.count:
        sentences.append("No pose has sets enough to tell whether one of them stands off.")
    return Section("Outlying sets and recordings", (*sentences, *more), tables=_scatter_tables(outliers))


def deviations_by_set(outliers: Outliers) -> list[list[Deviation]]:
    """Deviations that belong to one set together, the most certain set first.

    Parameters
    ----------
    outliers
        Deviations that were found.
    """
    groups: dict[int, list[Deviation]] = {}
    for one in outliers.deviations:
        groups.setdefault(one.row, []).append(one)
    return list(groups.values())


def error_bar_sentences(outliers: Outliers) -> list[str]:
    """Say where stated errors are evidently too small or too large against the repeats.

    Parameters
    ----------
    outliers
        Deviations, with the check of the stated errors.
    """
    found = []
    for quantity, check in outliers.error_bars.items():
        if not np.isfinite(check.ratio) or check.p_value > 0.01 or 0.5 < check.ratio < 2.0:
            continue
        factor = float(np.sqrt(check.ratio))
        kind = "too small" if factor > 1 else "too large"
        found.append(
            f"The fits' error bars of the {quantity} are {kind}: repeats scatter {factor:.2g} times as much as they "
            f"say (reduced chi-square {check.ratio:.2g}, {check.freedom} degrees of freedom). Drift and outliers are "
            "judged by the scatter between repeats."
        )
    return found


def _smallest(drifts: Drifts) -> Table:
    rows = tuple((quantity, label_words(label), f"{100 * change:.2g}") for quantity, label, change in drifts.smallest)
    columns = ("quantity", "label", "smallest change (%)")
    return Table(
        "Smallest change from end to end that the typical pose would have shown (probability 80 %)", columns, rows
    )


def _trend_table(title: str, drifts: Drifts) -> Table:
    rows = tuple(_trend_row(one) for one in drifts.suspects[:MOST_ROWS])
    return Table(title, ("pose", "quantity", "label", "change (%)", "probability"), rows)


def _trend_row(one: Trend) -> tuple[str, ...]:
    what = mode_words(one.series.mode, one.series.frequency, one.series.quantity)
    return one.series.pose, what, label_words(one.label), _change(one), f"{one.p_value:.2g}"


def _pooled_table(pooled: Sequence[PooledTrend]) -> Table:
    ordered = sorted(pooled, key=lambda one: (one.p_value, one.mode, one.quantity, one.label))[:MOST_ROWS]
    rows = tuple(
        (
            mode_words(one.mode, one.frequency, one.quantity),
            label_words(one.label),
            str(one.poses),
            _change(one),
            f"{100 * one.between * one.span:.2g}",
            f"{one.p_value:.2g}",
        )
        for one in ordered
    )
    columns = ("quantity", "label", "poses", "mean change (%)", "between poses (%)", "probability")
    return Table("Mean change over the typical span of the label in a pose, ± 95 %", columns, rows)


def _change(one: Trend | PooledTrend) -> str:
    """A change with its sign and half width, for a column in per cent."""
    return percent(one.change, one.half_width, sign=True).removesuffix(" %")


def _scatter_tables(outliers: Outliers) -> tuple[Table, ...]:
    rows = tuple(
        (quantity, "-" if mode == 0 else "several" if mode < 0 else str(mode), f"{100 * value:.2g}")
        for (quantity, mode), value in sorted(outliers.scatter.items())
    )
    if not rows:
        return ()
    title = "Scatter between sets of one pose beyond the fits' error bars, one standard deviation"
    return (Table(title, ("quantity", "mode", "scatter (%)"), rows),)
