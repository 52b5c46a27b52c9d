from .examples import EXAMPLES, commands_in, with_examples
from .number_lists import options_of_several, with_lists_apart
from .parser_words import usage_in_words

__all__ = [
    "EXAMPLES",
    "commands_in",
    "options_of_several",
    "usage_in_words",
    "with_examples",
    "with_lists_apart",
]
