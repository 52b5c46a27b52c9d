from .concealment import ConcealOptions, run_concealed
from .concealment_result import concealment_table
from .whole_chain import (
    CUTTER,
    IMMERSIONS,
    SWEEP_DEPTH,
    SWEEP_RPM,
    SWEEP_SECONDS,
    DemoOptions,
    comparison_tables,
    cutting_text,
    run_demo,
)

__all__ = [
    "CUTTER",
    "IMMERSIONS",
    "SWEEP_DEPTH",
    "SWEEP_RPM",
    "SWEEP_SECONDS",
    "ConcealOptions",
    "DemoOptions",
    "comparison_tables",
    "concealment_table",
    "cutting_text",
    "run_concealed",
    "run_demo",
]
