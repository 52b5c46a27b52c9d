from .collocated_period import PeriodOperator, period_operator, piece_nodes
from .depth_series import TransitionSeries, Windows, series_windows, transition_series
from .floquet_multipliers import Multipliers, kind_of, monodromies, multipliers
from .growing_cuts import unstable_cuts
from .loop_gain import LoopGain
from .varied_edges import VariedCut, period_angle, varied_cut

__all__ = [
    "LoopGain",
    "Multipliers",
    "PeriodOperator",
    "TransitionSeries",
    "VariedCut",
    "Windows",
    "kind_of",
    "monodromies",
    "multipliers",
    "period_angle",
    "period_operator",
    "piece_nodes",
    "series_windows",
    "transition_series",
    "unstable_cuts",
    "varied_cut",
]
