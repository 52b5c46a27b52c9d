from .double_hits import tap_concerns
from .options import TapOptions
from .points_table import PointsTable
from .run import TapResult, tap_recordings
from .summary import tap_tables
from .writing import write_taps

__all__ = [
    "PointsTable",
    "TapOptions",
    "TapResult",
    "tap_concerns",
    "tap_recordings",
    "tap_tables",
    "write_taps",
]
