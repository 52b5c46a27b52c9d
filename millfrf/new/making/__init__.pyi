from .mapping_file import mapping_for
from .plain_files import cut_text, session_text
from .robot_file import Asked, write_new_robot

__all__ = [
    "Asked",
    "cut_text",
    "mapping_for",
    "session_text",
    "write_new_robot",
]
