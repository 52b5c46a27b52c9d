"""How much memory a job may take: refused in one line before it starts, instead of a machine that stands still."""

import os

from .errors import InputError, TooLarge

VARIABLE = "MILLFRF_MEMORY_GB"
_USUAL_GB = 0.7
"""Beside the program itself, which takes 0.2 to 0.3 GB."""


def allowed_bytes() -> float:
    """Memory that the data of one job may take: 0.7 GB, or what the variable ``MILLFRF_MEMORY_GB`` says.

    Raises
    ------
    InputError
        The variable is no positive number.
    """
    given = os.environ.get(VARIABLE, str(_USUAL_GB))
    try:
        allowed = float(given)
    except ValueError:
        allowed = 0.0
    if not 0.0 < allowed < 1e6:
        raise InputError(f"{VARIABLE} is {given!r}; give a number of GB such as 8, or unset it")
    return allowed * 1e9


def require_memory(needed: float, subject: str, remedy: str) -> None:
    """Refuse a job that would take more memory than is allowed.

    Parameters
    ----------
    needed : bytes
        Largest memory that the job's data take at one time.
    subject
        What takes it, such as ``big.h5 (5.6 h, 12 channels)``.
    remedy
        What the user can do instead.

    Raises
    ------
    TooLarge
        It needs more.

    Examples
    --------
    >>> require_memory(1e6, "small.h5", "take less")
    >>> require_memory(8e9, "big.h5", "take less")
    Traceback (most recent call last):
    ...
    foundation.errors.TooLarge: big.h5: this takes about 8 GB of memory, 0.7 GB are allowed; take less, or set ...
    """
    allowed = allowed_bytes()
    if needed > allowed:
        raise TooLarge(
            f"{subject}: this takes about {needed / 1e9:.2g} GB of memory, {allowed / 1e9:g} GB are allowed; {remedy}, "
            f"or set {VARIABLE}={needed / 1e9 + 1:.0f}"
        )
