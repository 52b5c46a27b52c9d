"""Services of the running process: messages to the user, memory limits, child processes that end with their parent."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

from .errors import InputError, TooLarge

PR_SET_PDEATHSIG = 1
"""Number of Linux's request for a signal at the parent's death (prctl, linux/prctl.h)."""


def end_with(parent: int) -> None:
    """Let Linux end this process when the thread that made it ends, however its process was ended.

    A worker whose parent was killed would else wait for work for ever, with the memory that it holds and the pipe
    that the parent wrote to. Other systems know no such signal; nothing is done there.

    Parameters
    ----------
    parent
        Number of the process that made this one.
    """
    if not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    # it may have ended before it was asked for
    if os.getppid() != parent:
        os._exit(1)


def process_pool(workers: int, kernels: Sequence[str] = ()) -> ProcessPoolExecutor:
    """A pool of processes that end with this one.

    Parameters
    ----------
    workers
        Number of processes at most.
    kernels
        Modules whose kernels the processes need; they are compiled first.
    """
    if kernels:
        from .compilation import compile_kernels  # numba takes longer to load than all else of this module

        compile_kernels(*kernels)
    return ProcessPoolExecutor(workers, initializer=end_with, initargs=(os.getpid(),))


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
    millfrf.core.errors.TooLarge: big.h5: this takes about 8 GB of memory, 0.7 GB are allowed; take less, or set ...
    """
    allowed = allowed_bytes()
    if needed > allowed:
        raise TooLarge(
            f"{subject}: this takes about {needed / 1e9:.2g} GB of memory, {allowed / 1e9:g} GB are allowed; {remedy}, "
            f"or set {VARIABLE}={needed / 1e9 + 1:.0f}"
        )


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
