"""Physics that a computed cutting force may leave out: one file each; a file with ``PHYSICS`` is found by itself."""

import importlib
import pkgutil

from .protocol import CutPhysics, ToothView

__all__ = ["CutPhysics", "ToothView", "library"]


def library() -> dict[str, CutPhysics]:
    """All causes in this folder by name.

    Examples
    --------
    >>> sorted(library())
    ['process_damping', 'regenerative_feedback', 'runout']
    """
    found: dict[str, CutPhysics] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        cause = getattr(importlib.import_module(f"{__name__}.{module.name}"), "PHYSICS", None)
        if cause is not None:
            found[cause.name] = cause
    return found
