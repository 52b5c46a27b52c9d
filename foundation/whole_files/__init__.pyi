from .full_disk import is_disk_full
from .leftovers import LeftoverRemoved
from .writing import writing_whole_file, writing_whole_folder

__all__ = ["LeftoverRemoved", "is_disk_full", "writing_whole_file", "writing_whole_folder"]
