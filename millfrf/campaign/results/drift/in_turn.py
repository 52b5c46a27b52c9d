"""Drift and outliers in turn: an outlier hides the drift of other poses, and a drift looks like outliers."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .judged import Drifts, find_drifts
from .labels import Labels
from .outliers import Outliers, find_outliers
from .series import Series


def drifts_and_outliers(series: Sequence[Series], labels: Labels) -> tuple[Drifts, Outliers]:
    """Find what drifts, then what stands off; then what drifts without the values that stand off.

    Parameters
    ----------
    series
        Series of all poses.
    labels
        Labels of all sets.
    """
    drifts = find_drifts(series, labels)
    outliers = find_outliers(series, labels, drifts)
    if not any(not one.rivals for one in outliers.deviations):
        return drifts, outliers
    drifts = find_drifts(without(series, outliers), labels)
    return drifts, find_outliers(series, labels, drifts)


def without(series: Sequence[Series], outliers: Outliers) -> list[Series]:
    """The series without the values that stand off; where it cannot be told which one does, both stay.

    Parameters
    ----------
    series
        Series of all poses.
    outliers
        Deviations that were found.
    """
    off = {(id(one.series), one.row) for one in outliers.deviations if not one.rivals}
    found = []
    for one in series:
        kept = np.array([(id(one), row) not in off for row in one.rows], dtype=bool)
        rows = tuple(one.rows[k] for k in np.flatnonzero(kept))
        found.append(one if kept.all() else replace(one, rows=rows, logs=one.logs[kept], errors=one.errors[kept]))
    return [one for one in found if one.rows]
