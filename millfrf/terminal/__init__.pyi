from .rich_output import as_it_stands, print_table, printable, progress_bar
from .saying import answer, say

__all__ = [
    "answer",
    "as_it_stands",
    "print_table",
    "printable",
    "progress_bar",
    "say",
]
