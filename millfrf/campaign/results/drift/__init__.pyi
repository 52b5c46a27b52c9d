from .in_turn import drifts_and_outliers
from .judged import Drift, Drifts, find_drifts
from .labels import TIME, Labels, labels_of
from .outliers import Deviation, Outliers, find_outliers
from .pooled import PooledTrend, pool
from .series import DAMPING, DEPTH, FREQUENCY, Series, series_of
from .trends import Trend, trends_over
from .weighted_fit import ErrorBarCheck

__all__ = [
    "DAMPING",
    "DEPTH",
    "FREQUENCY",
    "TIME",
    "Deviation",
    "Drift",
    "Drifts",
    "ErrorBarCheck",
    "Labels",
    "Outliers",
    "PooledTrend",
    "Series",
    "Trend",
    "drifts_and_outliers",
    "find_drifts",
    "find_outliers",
    "labels_of",
    "pool",
    "series_of",
    "trends_over",
]
