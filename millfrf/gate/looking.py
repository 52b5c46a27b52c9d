"""Asking the gate where nothing is computed: an inspection and a report show what is refused, and go on."""

from collections.abc import Callable
from typing import TypeVar

from millfrf.core import InputError

T = TypeVar("T")


def doubts_of(check: Callable[[T, str], list[str]], given: T, name: str) -> list[str]:
    """Collect the doubts of a check; a refusal counts as one more doubt.

    Parameters
    ----------
    check
        Check of the gate, a function of what is given and of the name of its file.
    given, name
        Object that is checked, and the name of its file.
    """
    try:
        return check(given, name)
    except InputError as error:
        return [str(error)]
