from .in_browser import check_pick, pick_in_browser
from .picked_file import write_picked
from .serving import pick_poles
from .session import PickSession, chosen_at_first, drawn_page, fitted_answer

__all__ = [
    "PickSession",
    "check_pick",
    "chosen_at_first",
    "drawn_page",
    "fitted_answer",
    "pick_in_browser",
    "pick_poles",
    "write_picked",
]
