"""Checks and rewriting of typed arguments, before the parser sees them: its own messages do not name the value."""

import difflib
import inspect
import re
from collections.abc import Callable, Sequence
from typing import Any

from millfrf.core import InputError
from millfrf.core.steps import describe

from .commands import FORMER_NAMES


def check_names(words: str, function: Callable[..., Any], flags: Sequence[str], arguments: Sequence[str]) -> None:
    """Refuse an unknown option, proposing the nearest known one, and an option that is given twice."""

    described = describe(inspect.unwrap(function)).options
    named = [option for option in described if option.public and not option.positional]
    names = [option.typed for option in named] + [f"--{name}" for name in flags]
    once = [option.typed for option in named if not option.repeatable]
    typed = [word.partition("=")[0] for word in arguments]
    for name in typed:
        if name in once and typed.count(name) > 1:
            raise InputError(f"{name} is given {typed.count(name)} times; give it once")
        if name.startswith("--") and name not in names:
            near = [known for known in names if known.startswith(name)] or difflib.get_close_matches(name, names, 1)
            remedy = f"did you mean {near[0]}?" if near else f"'millfrf {words} --help' lists the options"
            raise InputError(f"millfrf {words} has no option {name}; {remedy}")


UNITS = {"M": "metres", "HZ": "Hz", "RPM": "rpm", "S": "seconds"}
"""Units by the word that stands for a number in help texts."""


def check_numbers(function: Callable[..., Any], typed: Sequence[str]) -> None:
    """Refuse ``20.5`` for a whole number, which the parser would truncate to 20, and a number with its unit."""
    options = {option.typed: option for option in describe(inspect.unwrap(function)).options}
    for place, word in enumerate(typed):
        name, joined, value = word.partition("=")
        if name not in options:
            continue
        numbers = [value] if joined else typed[place + 1 :]
        for kind, number in zip(options[name].number_types, numbers, strict=False):
            if kind is int and _is_number(number) and not re.fullmatch(r"[+-]?\d+", number):
                raise InputError(f"{name} {number}: give a whole number")
            if re.fullmatch(r"[+-]?[\d.]+ ?[A-Za-z/%]+", number) and not _is_number(number):
                unit = UNITS.get(options[name].marker.metavar)
                raise InputError(f"{name} {number}: give a number without unit{f', in {unit}' if unit else ''}")


def with_present_names(words: str, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Replace former names of options by the present ones, with a note for each.

    Examples
    --------
    >>> with_present_names("robot modes", ["kuka_kr90_r3100", "--count", "4"])
    (['kuka_kr90_r3100', '--modes', '4'], ['--count of robot modes is called --modes now'])
    """
    names = FORMER_NAMES.get(words, {})
    result, notes = [], []
    for word in arguments:
        option, joined, value = word.partition("=")
        if option in names:
            notes.append(f"{option} of {words} is called {names[option]} now")
        result.append(names.get(option, option) + joined + value)
    return result, notes


def with_lists_apart(arguments: Sequence[str], function: Callable[..., Any]) -> list[str]:
    """Split lists of numbers into words, so that ``--band 5,20`` and ``--band 5 20`` are equal.

    The signature of the step says how many numbers an option takes. A single number stands for all where an option
    takes shares. `InputError` is raised for a list of another length.
    """
    options = {option.typed: option for option in describe(inspect.unwrap(function)).options if option.count > 1}
    result: list[str] = []
    waiting = list(arguments)
    while waiting:
        name, joined, value = waiting.pop(0).partition("=")
        option = options.get(name)
        if option is None or not (joined or waiting):
            if not joined and name.startswith("--") and waiting and re.match(r"-([\d.][^,]*|[XYZ]),", waiting[0]):
                # values such as -10,20,90 and axes such as -X,+Y,+Z: the parser would take them for an option
                joined, value = "=", waiting.pop(0)
            result.append(name + joined + value)
            continue
        typed = value if joined else waiting.pop(0)
        alone = not (waiting and _is_number(waiting[0]))
        numbers = _numbers(name, typed, option.count, alone and option.marker.metavar == "F D S")
        while len(numbers) < option.count and waiting and _is_number(waiting[0]):
            numbers.append(waiting.pop(0))
        if len(numbers) != option.count or not all(map(_is_number, numbers)):
            raise InputError(f"{name} {' '.join(numbers)}: give {option.count} numbers {option.marker.metavar}")
        result += [name, *numbers]
    return result


def _numbers(name: str, typed: str, count: int, one_for_all: bool) -> list[str]:
    """Split the word behind an option: itself, the parts of a list, or one number for all."""
    parts = [part.strip() for part in typed.split(",") if part.strip()]
    if len(parts) == 1 and one_for_all and _is_number(parts[0]):
        return parts * count
    if "," not in typed:
        return [typed]
    if len(parts) != count:
        more = ", or one for all" if one_for_all else ""
        raise InputError(f"{name} {typed}: give {count} numbers with commas and no spaces between them{more}")
    return parts


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
