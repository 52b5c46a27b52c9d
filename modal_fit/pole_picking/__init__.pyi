from .offered_groups import CandidateGroup, candidate_groups
from .picked_fit import fit_picked_poles
from .poles_file import PolesFile, read_picked_poles, read_pole_groups, write_pole_candidates

__all__ = [
    "CandidateGroup",
    "PolesFile",
    "candidate_groups",
    "fit_picked_poles",
    "read_picked_poles",
    "read_pole_groups",
    "write_pole_candidates",
]
