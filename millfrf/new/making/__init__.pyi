from .robot_file import Asked, write_new_robot

__all__ = [
    "Asked",
    "write_new_robot",
]
