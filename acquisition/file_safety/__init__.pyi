from .damage import open_for_reading, reporting_damage, require_stored, whole_rows
from .durability import SpareSpace, Syncer, is_being_written, is_disk_full
from .guarded_reading import read_guarded

__all__ = [
    "SpareSpace",
    "Syncer",
    "is_being_written",
    "is_disk_full",
    "open_for_reading",
    "read_guarded",
    "reporting_damage",
    "require_stored",
    "whole_rows",
]
