from .full_disk import is_disk_full
from .keeping import free_name, keeping_files, keeps_files, refuse_replacing
from .leftovers import LeftoverRemoved, remove_leftovers
from .writing import writing_whole_file, writing_whole_folder

__all__ = [
    "LeftoverRemoved",
    "free_name",
    "is_disk_full",
    "keeping_files",
    "keeps_files",
    "refuse_replacing",
    "remove_leftovers",
    "writing_whole_file",
    "writing_whole_folder",
]
