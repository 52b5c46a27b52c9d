from .hidden_modes import hidden_candidates
from .selection import Reweigh, Selection, select_modes
from .steady_poles import Candidate, candidates, default_order

__all__ = [
    "Candidate",
    "Reweigh",
    "Selection",
    "candidates",
    "default_order",
    "hidden_candidates",
    "select_modes",
]
