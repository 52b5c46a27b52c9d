"""The Python interface, ``import millfrf as mf``: one function a step of the work, and the types that they return.

``__init__.pyi`` lists the names and their modules. A module is imported when one of its names is first used, so that
``import millfrf`` and ``millfrf --version`` take milliseconds.
"""

from importlib.util import find_spec
from pathlib import Path

from .lazy_front import lazy_front

PACKAGES = ("acquisition", "estimation", "modal_fit", "replay_data")
"""Packages that are installed beside this one."""


def _refuse_hidden_packages() -> None:
    """Refuse to start where a file of the user, such as ``estimation.py``, would be imported in place of ours."""
    here = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        spec = find_spec(name)
        if spec is not None and spec.origin and (origin := Path(spec.origin).resolve()).parents[1] != here:
            hiding = origin.parent if origin.name == "__init__.py" else origin
            raise ImportError(f"{hiding} hides the package '{name}' of millfrf: rename it")


_refuse_hidden_packages()

__getattr__, __dir__ = lazy_front(__name__, __file__)
