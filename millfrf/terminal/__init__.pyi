from .control_characters import printable
from .manners import Manner, document, manner, speaking, tell
from .plain_values import plain
from .rich_output import as_it_stands, print_table, progress_bar
from .saying import answer, aside, note, print_document, say

__all__ = [
    "Manner",
    "answer",
    "as_it_stands",
    "aside",
    "document",
    "manner",
    "note",
    "plain",
    "print_document",
    "print_table",
    "printable",
    "progress_bar",
    "say",
    "speaking",
    "tell",
]
