"""The library of causes: one small file each; a file that defines ``PHYSICS`` is found by itself."""

import importlib
import pkgutil

from .protocol import Chain, ChainPhysics, JointPhysics, Parameter, Physics, answer_name

__all__ = ["Chain", "ChainPhysics", "JointPhysics", "Parameter", "Physics", "answer_name", "library"]


def library() -> dict[str, Physics]:
    """All causes in this folder by name.

    Examples
    --------
    >>> "coulomb_friction" in library()
    True
    """
    found: dict[str, Physics] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        cause = getattr(importlib.import_module(f"{__name__}.{module.name}"), "PHYSICS", None)
        if cause is not None:
            found[cause.name] = cause
    return found
