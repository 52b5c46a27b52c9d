from .fault_repair import repair_faults, with_tones_settled
from .shown_faults import residual_lines, with_faults

__all__ = [
    "repair_faults",
    "residual_lines",
    "with_faults",
    "with_tones_settled",
]
