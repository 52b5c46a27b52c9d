"""The engines by name; what they need is imported when one is called."""

import importlib
from collections.abc import Callable

from .problem import Answer, Problem

ENGINES = {
    "ours": ("ours", "this project's poly-reference fit, no choice by hand"),
    "sdypy": ("rival_sdypy", "sdypy-EMA, LSCF"),
    "sdynpy": ("rival_sdynpy", "SDynPy, PolyPy"),
    "pyoma": ("rival_pyoma", "pyOMA-2, pLSCF on FRFs as half spectra"),
}


def engine(name: str) -> Callable[[Problem], Answer]:
    """``find_modes`` of an engine.

    Raises
    ------
    ValueError
        There is no engine of that name.
    """
    if name not in ENGINES:
        raise ValueError(f"there is no engine {name!r}; choose one of {', '.join(ENGINES)}")
    module = importlib.import_module(f".{ENGINES[name][0]}", __package__)
    result: Callable[[Problem], Answer] = module.find_modes
    return result
