"""What a deep part of the program tells whoever runs it, without a word to print: a wait that has a reason."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []
"""Of the whole process: what is told in a thread of a computation reaches the command that began it."""


def notice(text: str) -> None:
    """Tell something to the listener of the command at hand; without one nothing is told.

    Parameters
    ----------
    text
        What is to be known, as one sentence without a full stop.
    """
    for listener in _listeners[-1:]:
        listener(text)


@contextmanager
def notices_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Let a listener hear the notices of a block.

    Parameters
    ----------
    listener
        Called with each notice.

    Examples
    --------
    >>> with notices_to(print):
    ...     notice("compiling, once")
    compiling, once
    """
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
