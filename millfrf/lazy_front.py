"""Fronts of packages: names are listed in a stub, and a module is imported when one of its names is first used.

``import millfrf`` and ``millfrf --version`` take milliseconds, and a command loads what it needs.
"""

import ast
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_front(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make ``__getattr__`` and ``__dir__`` of a package from its stub ``__init__.pyi``.

    Parameters
    ----------
    package
        Name of the package.
    file
        Path of its ``__init__.py``.

    Examples
    --------
    In ``__init__.py``::

        __getattr__, __dir__ = lazy_front(__name__, __file__)
    """

    @cache
    def homes() -> dict[str, tuple[str, int, str]]:
        """For each name its module, the level of a relative import, and its name there."""
        stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
        lines = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
        imported = ((node.module or "", node.level, alias) for node in lines for alias in node.names)
        return {alias.asname or alias.name: (module, level, alias.name) for module, level, alias in imported}

    def get(name: str) -> Any:
        if name == "__all__":
            return sorted(homes())
        if name not in homes():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, level, original = homes()[name]
        value = getattr(import_module("." * level + module, package), original)
        setattr(import_module(package), name, value)
        return value

    return get, lambda: sorted(homes())
