"""How the trial compiles its inner loops; apart from the library's own, of which it shares nothing."""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile with numba at the first call and keep the machine code on disk."""
    return cast(Function, njit(cache=True, nogil=True)(function))
