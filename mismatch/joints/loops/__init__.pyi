from .joint_loop import driven_run, free_run
from .law_change_loop import law_change_run
from .modal_filter_loop import MOMENTS, filters_run
from .tangent_loop import tangent_run

__all__ = [
    "MOMENTS",
    "driven_run",
    "filters_run",
    "free_run",
    "law_change_run",
    "tangent_run",
]
