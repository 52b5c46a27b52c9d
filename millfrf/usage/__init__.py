"""Command lines as typed: examples, number lists, former names, messages of the parser."""

from .examples import EXAMPLES, commands_in, with_examples
from .former_names import FORMER_NAMES, with_names_of_today
from .framing import ANSWERING, FOLDERS, OWN_FOLDER, WRITING, framed, option_names
from .number_lists import options_of_several, with_lists_apart
from .parser_words import usage_in_words

__all__ = [
    "ANSWERING",
    "EXAMPLES",
    "FOLDERS",
    "FORMER_NAMES",
    "OWN_FOLDER",
    "WRITING",
    "commands_in",
    "framed",
    "option_names",
    "options_of_several",
    "usage_in_words",
    "with_examples",
    "with_lists_apart",
    "with_names_of_today",
]
