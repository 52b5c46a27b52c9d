from .chatter import CutChatter, chatter_of
from .reading import read_cut_recording, require_room_for_cut
from .recording import FINE, MOST_ORDERS, CutRecording, cut_recording
from .spindle_law import SpindleLaw, found_law, stated_law
from .tip_motion import TipMotion

__all__ = [
    "FINE",
    "MOST_ORDERS",
    "CutChatter",
    "CutRecording",
    "SpindleLaw",
    "TipMotion",
    "chatter_of",
    "cut_recording",
    "found_law",
    "read_cut_recording",
    "require_room_for_cut",
    "stated_law",
]
