"""Processes that do not outlive the one that made them, however that one ends."""

import ctypes
import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor

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


def process_pool(workers: int) -> ProcessPoolExecutor:
    """A pool of processes that end with this one.

    Parameters
    ----------
    workers
        Number of processes at most.
    """
    return ProcessPoolExecutor(workers, initializer=end_with, initargs=(os.getpid(),))
