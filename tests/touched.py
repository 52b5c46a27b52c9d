"""Select the long tests of a change: those whose files import a changed room, directly or through other rooms."""

import ast
import os
import subprocess
from functools import cache
from pathlib import Path

from millfrf.commands import STEPS

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("acquisition", "estimation", "modal_fit", "replay_data", "millfrf")


def room_of(module: str) -> str:
    """Room of a module: a package at the root, or a folder or module of ``millfrf``."""
    return ".".join(module.split(".")[: 2 if module.startswith("millfrf.") else 1])


def room_of_file(file: Path) -> str:
    """Room of a file of the product."""
    return room_of(".".join(file.relative_to(ROOT).with_suffix("").parts))


def imported_rooms(file: Path) -> set[str]:
    """Rooms that a file imports from, inside functions as well; a relative import stays in its own room."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and not node.level:
            modules |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
    return {room_of(module) for module in modules if module.split(".")[0] in PACKAGES}


@cache
def imports_of_rooms() -> dict[str, set[str]]:
    """For each room, those that its files import from; the command line imports each step by its name."""
    graph: dict[str, set[str]] = {"millfrf.commands": {room_of(place) for place in STEPS.values()}}
    for package in PACKAGES:
        for file in (ROOT / package).rglob("*.py"):
            graph.setdefault(room_of_file(file), set()).update(imported_rooms(file))
    return graph | {"millfrf.core": set()}  # a result draws itself with the figures: an import upwards, when asked to


def reached_rooms(file: Path) -> set[str]:
    """Rooms that a file imports from, directly or through others."""
    reached: set[str] = set()
    waiting = imported_rooms(file)
    while waiting:
        room = waiting.pop()
        reached.add(room)
        waiting |= imports_of_rooms().get(room, set()) - reached
    return reached


@cache
def changed_files_and_rooms() -> tuple[frozenset[Path], frozenset[str]]:
    """Files that differ from the commit ``$MILLFRF_BASE`` (default: the one before), and their rooms."""
    command = ["git", "diff", "--name-only", os.environ.get("MILLFRF_BASE", "HEAD~1")]
    names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    files = frozenset(ROOT / name for name in names)
    of_product = {file for file in files if file.relative_to(ROOT).parts[0] in PACKAGES}
    return files, frozenset(room_of_file(file) for file in of_product)


def is_touched(file: Path) -> bool:
    """Whether a change touches a test file, the files of its folder, or a room that it reaches."""
    files, rooms = changed_files_and_rooms()
    own = set(file.parent.glob("*.py")) | {ROOT / "pyproject.toml"}
    return bool(files & own) or bool(reached_rooms(file) & rooms)
