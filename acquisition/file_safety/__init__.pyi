from .checked_blocks import ENTRY, BlockTable, entries_of, row_sums, samples_sum
from .damage import open_for_reading, reporting_damage, require_stored, whole_rows
from .durability import SpareSpace, Syncer, is_being_written
from .guarded_reading import read_guarded

__all__ = [
    "ENTRY",
    "BlockTable",
    "SpareSpace",
    "Syncer",
    "entries_of",
    "is_being_written",
    "open_for_reading",
    "read_guarded",
    "reporting_damage",
    "require_stored",
    "row_sums",
    "samples_sum",
    "whole_rows",
]
