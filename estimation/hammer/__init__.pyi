from .agreement import Disagreement
from .cutting_out import screened
from .decay import Decay, answer_decay, window_for
from .merging import MergedTaps, merge_taps
from .screening import FoundTaps, JudgedTap, TapTest, found_taps, require_room_for_taps
from .segments import TapSettings, choose_segments, placed
from .sums import TapSums, tap_sums
from .taps import Tap, find_taps
from .windows import exponential_window, force_window, window_correlation, without_added_damping

__all__ = [
    "Decay",
    "Disagreement",
    "FoundTaps",
    "JudgedTap",
    "MergedTaps",
    "Tap",
    "TapSettings",
    "TapSums",
    "TapTest",
    "answer_decay",
    "choose_segments",
    "exponential_window",
    "find_taps",
    "force_window",
    "found_taps",
    "merge_taps",
    "placed",
    "require_room_for_taps",
    "screened",
    "tap_sums",
    "window_correlation",
    "window_for",
    "without_added_damping",
]
