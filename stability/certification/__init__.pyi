from .certified import certified_lobes
from .coupled_modes import CouplingJudgement, judge_mode_coupling

__all__ = [
    "CouplingJudgement",
    "certified_lobes",
    "judge_mode_coupling",
]
