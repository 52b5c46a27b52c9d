from .drift_pictures import trend_pictures
from .drifts import deviations_by_set, drift_section, error_bar_sentences, outlier_section
from .failures import all_failures, failure_section
from .maps import map_section
from .sets import set_section
from .trend_words import deviation_words, drift_words, label_words, mode_words, pooled_words
from .verdict import verdict_sentences

__all__ = [
    "all_failures",
    "deviation_words",
    "deviations_by_set",
    "drift_section",
    "drift_words",
    "error_bar_sentences",
    "failure_section",
    "label_words",
    "map_section",
    "mode_words",
    "outlier_section",
    "pooled_words",
    "set_section",
    "trend_pictures",
    "verdict_sentences",
]
