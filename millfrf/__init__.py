"""The Python interface, ``import millfrf as mf``: one function a step of the work, and the types that they return.

``__init__.pyi`` lists the names and their modules. A module is imported when one of its names is first used, so that
``import millfrf`` and ``millfrf --version`` take milliseconds.
"""

import ast
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

PACKAGES = ("acquisition", "estimation", "modal_fit", "replay_data")
"""Packages that are installed beside this one."""


def _refuse_hidden_packages() -> None:
    """Refuse to start where a file of the user, such as ``estimation.py``, would be imported in place of ours."""
    here = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        spec = find_spec(name)
        if spec is not None and spec.origin and (found := Path(spec.origin).resolve()).parents[1] != here:
            hiding = found.parent if found.name == "__init__.py" else found
            raise ImportError(f"{hiding} hides the package '{name}' of millfrf: rename it")


_refuse_hidden_packages()


@cache
def _homes() -> dict[str, tuple[str, int]]:
    """For each public name its module and the level of a relative import, as the stub states them."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    return {alias.name: (str(node.module), node.level) for node in lines for alias in node.names}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return sorted(_homes())
    if name not in _homes():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, level = _homes()[name]
    value = getattr(import_module("." * level + module, __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_homes())
