"""Options of several numbers, typed with commas or with spaces: ``--band 5,20`` and ``--band 5 20`` are one."""

from collections.abc import Mapping, Sequence
from typing import Any

from millfrf.core import InputError

ONE_FOR_ALL = ("--lab-error",)
"""Options of which a single number stands for all their numbers."""


def with_lists_apart(arguments: Sequence[str], counts: Mapping[str, int]) -> list[str]:
    """Give the words of a command line with each list of numbers as words of their own.

    Parameters
    ----------
    arguments
        The words as they were typed.
    counts
        How many numbers each option takes, for options that take several.

    Raises
    ------
    InputError
        A list with commas of another length than its option takes.

    Examples
    --------
    >>> with_lists_apart(["fit", "frf.h5", "--band", "5,20"], {"--band": 2})
    ['fit', 'frf.h5', '--band', '5', '20']
    >>> with_lists_apart(["diagnose", "--lab-error=0.02", "m.json"], {"--lab-error": 3})
    ['diagnose', '--lab-error', '0.02', '0.02', '0.02', 'm.json']
    """
    result: list[str] = []
    rest = list(arguments)
    while rest:
        option, joined, value = rest.pop(0).partition("=")
        if option not in counts or not (joined or rest):
            result.append(option + joined + value)
            continue
        typed = value if joined else rest.pop(0)
        alone = not (rest and _is_number(rest[0]))
        result += [option, *_numbers(option, typed, counts[option], alone)]
    return result


def options_of_several(command: Any, arguments: Sequence[str]) -> dict[str, int]:
    """How many numbers each option of the command that was asked for takes, for those that take several.

    Parameters
    ----------
    command
        The whole program, a group of click.
    arguments
        The words as they were typed.
    """
    for word in arguments:
        inner = getattr(command, "commands", {}).get(word)
        if inner is None:
            break
        command = inner
    found = [one for one in command.params if one.nargs > 1]
    return {name: one.nargs for one in found for name in one.opts if name.startswith("--")}


def _numbers(option: str, typed: str, count: int, alone: bool) -> list[str]:
    """What stands for one word behind an option: itself, the parts of a list, or one number for all."""
    parts = [part.strip() for part in typed.split(",") if part.strip()]
    for_all = option in ONE_FOR_ALL
    if len(parts) == 1 and alone and for_all and _is_number(parts[0]):
        return parts * count
    if "," not in typed:
        return [typed]
    if len(parts) != count:
        more = ", or one for all" if for_all else ""
        raise InputError(f"{option} {typed}: give {count} numbers with commas and no spaces between them{more}")
    return parts


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
