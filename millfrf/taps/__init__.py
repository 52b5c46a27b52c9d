"""From recordings of hammer tests to one FRF file: which point was hit where, taps judged, windows, averages."""

from .options import TapOptions
from .run import TapResult, tap_recordings
from .summary import tap_tables
from .writing import write_taps

__all__ = ["TapOptions", "TapResult", "tap_recordings", "tap_tables", "write_taps"]
