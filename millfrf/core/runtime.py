"""Services of the running process: messages to the user, memory limits, child processes that end with their parent."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager

from .errors import InputError, TooLarge

PR_SET_PDEATHSIG = 1  # Linux's request for a signal at the parent's death (prctl, linux/prctl.h)


def end_with(parent: int) -> None:
    """Let the system end this process when its parent process ends; this is possible on Linux only.

    Otherwise a worker whose parent was killed would wait for work for ever and keep its memory.
    """
    if not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    # the parent may have ended before the signal was requested
    if os.getppid() != parent:
        os._exit(1)


def process_pool(workers: int, kernels: Sequence[str] = ()) -> ProcessPoolExecutor:
    """Compile the kernels of the given modules, and make a pool of processes that end with this process."""
    if kernels:
        from .compilation import compile_kernels  # numba takes longer to load than all else of this module

        compile_kernels(*kernels)
    return ProcessPoolExecutor(workers, initializer=end_with, initargs=(os.getpid(),))


VARIABLE = "MILLFRF_MEMORY_GB"
_DEFAULT_GB = 0.7  # in addition to the program itself, which takes 0.2 to 0.3 GB


def allowed_bytes() -> float:
    """Return the memory (bytes) allowed for the data of a step: 0.7 GB, or the variable ``MILLFRF_MEMORY_GB``.

    Raises
    ------
    InputError
        The variable is no positive number.
    """
    given = os.environ.get(VARIABLE, str(_DEFAULT_GB))
    try:
        allowed = float(given)
    except ValueError:
        allowed = 0.0
    if not 0.0 < allowed < 1e6:
        raise InputError(f"{VARIABLE} is {given!r}; give a number of GB such as 8, or unset it")
    return allowed * 1e9


def require_memory(needed: float, subject: str, remedy: str) -> None:
    """Refuse a step that would take more memory than is allowed.

    Parameters
    ----------
    needed : bytes
        Largest memory that the data take at one time.
    subject
        Name of the data, such as ``big.h5 (5.6 h, 12 channels)``.
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


# One list for the whole process: a notice from a thread of a computation reaches the command that began it.
_listeners: list[Callable[[str], None]] = []


def notice(text: str) -> None:
    """Send one sentence without a full stop to the listener of the running command, if there is one."""
    for listener in _listeners[-1:]:
        listener(text)


@contextmanager
def notices_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Call a function with each notice that is sent within the block.

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
