"""Refuse to start where a user's file hides one of our packages: Python would import that file in its place.

A file ``stability.py`` in the working folder stands before the installed package ``stability`` on Python's path. This
module looks up where each name would come from; it imports none of them, and nothing heavy.
"""

import importlib.util
import sys
from pathlib import Path

ROOMS = (
    "foundation",
    "acquisition",
    "cutting",
    "estimation",
    "modal_fit",
    "stability",
    "replay_data",
    "robot_model",
    "mismatch",
    "figures",
)
"""The packages that are installed beside ``millfrf``."""

_PARENT = Path(__file__).resolve().parents[1]


def hiding_file() -> str:
    """One line that names the file and the package which it hides; empty where every package is ours."""
    for room in ROOMS:
        found = _origin(room)
        if found is not None and found.resolve().parents[1] != _PARENT:
            return f"{_shown(found)} hides the package '{room}' of millfrf: rename it"
    return ""


def refuse_hidden_packages() -> None:
    """Stop where a package is hidden: the command line with one line and exit code 2, an import by an error.

    Raises
    ------
    ImportError
        ``import millfrf``, where a file hides one of our packages.
    SystemExit
        The program ``millfrf`` or ``python -m millfrf``, after the line on standard error.
    """
    line = hiding_file()
    if not line:
        return
    program = Path(sys.argv[0]).stem if sys.argv else ""
    if program in ("millfrf", "-m"):  # "-m" stands there while Python looks for the module that it is to run
        print(f"millfrf: {line}", file=sys.stderr)
        raise SystemExit(2)
    raise ImportError(line)


def _origin(room: str) -> Path | None:
    """File that an import of the room gives; None where there is none, and the import itself will say so."""
    try:
        spec = importlib.util.find_spec(room)
        found = None if spec is None else spec.origin
    except ValueError:  # a module that was made by hand has no specification
        found = getattr(sys.modules[room], "__file__", None)
    return None if found is None else Path(found)


def _shown(path: Path) -> str:
    """The file as a user would type it: a package's folder, and relative where it lies in the working folder."""
    shown = path.parent if path.name == "__init__.py" else path
    here = Path.cwd()
    return f"./{shown.relative_to(here)}" if shown.is_relative_to(here) else str(shown)
