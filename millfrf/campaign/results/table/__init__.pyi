from .rows_of_modes import ModeName, mode_rows
from .table_files import write_mode_tables

__all__ = ["ModeName", "mode_rows", "write_mode_tables"]
