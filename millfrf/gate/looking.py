"""Asking the gate where nothing is computed: an inspection and a report show what is refused, and go on."""

from collections.abc import Callable
from typing import TypeVar

from foundation import InputError

T = TypeVar("T")


def doubts_of(check: Callable[[T, str], list[str]], given: T, name: str) -> list[str]:
    """Doubts of a check, and what it refuses as one more of them.

    Parameters
    ----------
    check
        Of the gate, for what is given and the name of its file.
    given, name
        What it is asked about.
    """
    try:
        return check(given, name)
    except InputError as error:
        return [str(error)]
