"""Messages for a wrong command line, in our words and with what was typed."""

import re
from collections.abc import Sequence
from itertools import pairwise

_INVALID = re.compile(r"Invalid value for '(?P<option>--[\w-]+)[^:]*: (?P<said>.*)", re.DOTALL)


def usage_in_words(said: str, arguments: Sequence[str], command: str = "millfrf") -> str:
    """Say in one line why a command line was not understood.

    Parameters
    ----------
    said
        Message of the parser.
    arguments
        The words of the command line as they were typed.
    command
        Command that did not understand them, such as ``millfrf robot modes``; its help is named.

    Examples
    --------
    >>> said = "Invalid value for '--modes': Input should be a valid integer"
    >>> usage_in_words(said, ["fit", "--modes", "2.5"], "millfrf fit")
    "--modes 2.5 is not understood: give a whole number. Try 'millfrf fit --help'."
    """
    help_of_it = f"Try '{command} --help'."
    if "unexpected extra argument" in said and _number_behind_force(arguments):
        return "--force takes no number: it replaces files that are there; the force on a robot's tip is --tip-force N."
    found = _INVALID.match(said)
    if found is None or not re.search(r"Input should|is not a valid", found["said"]):
        return f"{said} {help_of_it}"
    option = found["option"]
    typed = " ".join([option, *_values(option, arguments)])
    number = "integer" in found["said"]
    wanted = "a whole number" if number and len(typed.split()) == 2 else "a whole number for N" if number else "numbers"
    return f"{typed} is not understood: give {wanted}. {help_of_it}"


def _number_behind_force(arguments: Sequence[str]) -> bool:
    """Whether somebody types `--force 650`, as `robot stiffness` took it before."""
    return any(one == "--force" and re.fullmatch(r"[-+.\deE]+", other) for one, other in pairwise(arguments))


def _values(option: str, arguments: Sequence[str]) -> list[str]:
    """Give the words that were typed after an option, up to the next one."""
    if option not in arguments:
        return []
    rest = list(arguments[arguments.index(option) + 1 :])
    end = next((i for i, word in enumerate(rest) if word.startswith("--")), len(rest))
    return rest[:end]
