from .rich_output import as_it_stands, print_table, printable, progress_bar
from .saying import say

__all__ = ["as_it_stands", "print_table", "printable", "progress_bar", "say"]
