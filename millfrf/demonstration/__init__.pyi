from .concealment import ConcealOptions, run_concealed
from .concealment_result import concealment_table
from .whole_chain import (
    SWEEP_DEPTH,
    SWEEP_RPM,
    SWEEP_SECONDS,
    DemoOptions,
    comparison_tables,
    run_demo,
)

__all__ = [
    "SWEEP_DEPTH",
    "SWEEP_RPM",
    "SWEEP_SECONDS",
    "ConcealOptions",
    "DemoOptions",
    "comparison_tables",
    "concealment_table",
    "run_concealed",
    "run_demo",
]
