from .mapping_file import mapping_for
from .plain_files import campaign_text, cut_text, session_text
from .robot_file import Asked, write_new_robot

__all__ = [
    "Asked",
    "campaign_text",
    "cut_text",
    "mapping_for",
    "session_text",
    "write_new_robot",
]
