from .rows_of_modes import ModeName, as_utc, mode_rows
from .table_files import write_mode_tables

__all__ = ["ModeName", "as_utc", "mode_rows", "write_mode_tables"]
