"""What a deep part of the program tells whoever runs it, without a word to print: a wait that has a reason."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)


def notice(text: str) -> None:
    """Tell something to the listener of the code at hand; without one nothing is told.

    Parameters
    ----------
    text
        What is to be known, as one sentence without a full stop.
    """
    listener = _listener.get()
    if listener is not None:
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
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
