"""Compilation of inner loops with numba: cached on disk, without the interpreter lock."""

from collections.abc import Callable
from functools import cache
from typing import TypeVar, cast

from numba import njit
from numba.core import event

from .runtime import notice

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile ``function`` with numba at its first call; division by zero gives infinity, as in NumPy.

    The machine code is kept beside the source (or in the user's cache folder where that cannot be written), so that
    only the first run on a machine pays for it. That run tells why it waits (:func:`millfrf.core.runtime.notice`).
    """
    _tell_of_compilations()
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))


class _Compilations(event.Listener):  # type: ignore[misc]
    """Tells of the first compilation; code that is read from the cache is none."""

    def on_start(self, event: event.Event) -> None:
        del event
        _say_once()

    def on_end(self, event: event.Event) -> None:
        del event


@cache
def _tell_of_compilations() -> None:
    """Listen to numba, from the first function on."""
    event.register("numba:compile", _Compilations())


@cache
def _say_once() -> None:
    notice("compiling inner loops, once on this computer: up to a minute")
