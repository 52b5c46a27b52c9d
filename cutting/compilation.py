"""The one way this project compiles an inner loop: cached on disk, without the interpreter's lock."""

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def compiled(function: Function) -> Function:
    """Compile ``function`` with numba at its first call; division by zero gives infinity, as in NumPy.

    The machine code is kept beside the source (or in the user's cache folder where that cannot be written), so that
    only the first run on a machine pays for it.
    """
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))
