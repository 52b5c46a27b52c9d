from .double_hits import tap_concerns
from .options import TapOptions
from .run import TapResult, tap_recordings
from .summary import tap_tables
from .writing import write_taps

__all__ = [
    "TapOptions",
    "TapResult",
    "tap_concerns",
    "tap_recordings",
    "tap_tables",
    "write_taps",
]
