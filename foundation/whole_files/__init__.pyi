from .full_disk import is_disk_full
from .leftovers import LeftoverRemoved, remove_leftovers
from .writing import writing_whole_file, writing_whole_folder

__all__ = ["LeftoverRemoved", "is_disk_full", "remove_leftovers", "writing_whole_file", "writing_whole_folder"]
