"""Compilation of inner loops (kernels) with numba: cached for each user, and compiled in one step at the first use.

Machine code is stored in the user's cache folder, in a folder for each version of the kernels' sources, so that stale
code is never loaded. Where no such folder can be written, each run compiles in memory.
"""

import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast, overload

import numba
from numba.core import sigutils
from numba.core.dispatcher import Dispatcher

from .progress import progress
from .terminal import aside

Function = TypeVar("Function", bound=Callable[..., object])
Example = Callable[[], tuple[Any, ...]]

CUTTING = ("millfrf.cutting.tooth", "millfrf.cutting.chip_law")
SIMULATION = ("replay_data.joints", "replay_data.modal_integrator", "replay_data.milling_loop")
STABILITY = (
    "millfrf.stability.floquet.depth_series",
    "millfrf.stability.floquet.characteristic",
    "millfrf.stability.floquet.critical_lines",
    "millfrf.stability.floquet.winding_numbers",
    "millfrf.cutting.earlier_motions",
    "millfrf.cutting.sliced_edge",
    "millfrf.stability.floquet.cut_layout",
    "millfrf.stability.floquet.piece_response",
    "millfrf.stability.floquet.period_map",
    "millfrf.stability.floquet.cut_period",
    "millfrf.stability.floquet.growth",
)
FORCED = ("millfrf.stability.forced.edge_passes", "millfrf.stability.solvers.varied_speed")
DIAGNOSIS = (
    "millfrf.mismatch.structure.structured_residual",
    "millfrf.mismatch.records.noise_loops",
    "millfrf.mismatch.joints.time_loops",
    "millfrf.mismatch.joints.coupled_loops",
    "millfrf.mismatch.joints.tangent_loops",
    "millfrf.mismatch.models.modal_lines",
)
KERNELS = (*CUTTING, *SIMULATION, *STABILITY, *FORCED, *DIAGNOSIS)
"""Modules with compiled functions, by the work that needs them."""


@overload
def compiled(function: Function, /) -> Function: ...
@overload
def compiled(*signatures: str, example: Example | None = None) -> Callable[[Function], Function]: ...
def compiled(*signatures: Any, example: Example | None = None) -> Any:
    """Compile a function with numba; a division by zero gives infinity, as in NumPy.

    A function that Python calls states the types of its arguments for :func:`compile_kernels`. A function that only
    compiled functions call states no types. For other types, a function is compiled at its first call with them.

    Parameters
    ----------
    signatures
        Types of the arguments as numba writes them, such as ``"(float64, float64[::1])"``; or the function itself,
        where no types are stated.
    example
        A function that gives arguments of the right types, for types that numba has no text for (named tuples).

    Examples
    --------
    ::

        @compiled("(float64, float64)")
        def ratio(a, b):
            return a / b  # infinity where b is zero
    """
    if signatures and callable(signatures[0]):
        return _dispatcher(signatures[0], (), None)
    return lambda function: _dispatcher(function, signatures, example)


def inner_loop(function: Function) -> Function:
    """Compile a function that only compiled functions call, that creates no array, and that runs many times.

    Numba counts references to each array that a function receives or takes from a tuple, by atomic operations that may
    take longer than the arithmetic of an inner loop. A function that creates no array needs no such count. It is
    inlined, as a call passes every array of a tuple by value.
    """
    return cast(Function, _dispatcher(function, (), None, counted=False))


def product_loop(function: Function) -> Function:
    """Compile an inner loop whose sums may be added up in any order, and so several terms at a time."""
    return cast(Function, _dispatcher(function, (), None, counted=False, ordered=False))


def _dispatcher(
    function: Callable[..., object],
    signatures: tuple[str, ...],
    example: Example | None,
    *,
    counted: bool = True,
    ordered: bool = True,
) -> Any:
    stored = cache_folder() is not None
    options: dict[str, Any] = {} if counted else {"_nrt": False, "forceinline": True}
    options |= {} if ordered else {"fastmath": {"reassoc", "nsz", "contract"}}
    dispatcher = numba.njit(cache=stored, nogil=True, error_model="numpy", **options)(function)
    dispatcher.stated_signatures = signatures
    dispatcher.example = example
    return dispatcher


def compile_kernels(*modules: str) -> None:
    """Compile the kernels of some modules before a timed computation or a fork of the process; once on a computer.

    Parameters
    ----------
    modules
        Names of modules, such as those of :data:`STABILITY`.
    """
    folder = cache_folder()
    new = [module for module in modules if folder is None or not (folder / module).exists()]
    kernels = [kernel for module in new for kernel in _kernels_of(import_module(module)) if not kernel.signatures]
    if not kernels:
        return
    once = "once on this computer" if folder else "in each run, as no cache folder can be written"
    aside(f"compiling inner loops, {once}: up to a minute")
    with progress("compiling", len(kernels)) as update:
        for number, kernel in enumerate(kernels, 1):
            for signature in kernel.stated_signatures:
                arguments, _ = sigutils.normalize_signature(signature)  # the cache's key is these types, not the text
                kernel.compile(arguments)
            if kernel.example:
                kernel.compile(tuple(numba.typeof(value) for value in kernel.example()))
            update(number)
    if folder:
        for module in new:
            (folder / module).touch()


def _kernels_of(module: ModuleType) -> Iterator[Any]:
    """Yield the compiled functions that a module defines."""
    for value in vars(module).values():
        if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__:
            yield value


@cache
def cache_folder() -> Path | None:
    """Return the folder for the machine code of the present sources, and create it; None if it cannot be created."""
    root = _user_cache()
    if root is None:
        return None
    folder = root / "millfrf" / f"kernels-{_digest()}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    if not os.access(folder, os.W_OK):
        return None
    numba.config.CACHE_DIR = str(folder)
    return folder


def _user_cache() -> Path | None:
    """Return the user's cache folder by the conventions of the system; None for a user without a home folder."""
    stated = os.environ.get("XDG_CACHE_HOME") or (os.environ.get("LOCALAPPDATA") if os.name == "nt" else None)
    if stated:
        return Path(stated)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache")


def _digest() -> str:
    """Return a digest of the kernels' sources and of the versions of Python and numba."""
    root = Path(__file__).resolve().parents[2]
    content = hashlib.sha256(f"{sys.version} {numba.__version__}".encode())
    for module in KERNELS:
        content.update((root / f"{module.replace('.', '/')}.py").read_bytes())
    return content.hexdigest()[:16]
