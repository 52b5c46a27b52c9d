"""Rooms import each other through their fronts, fronts offer what others use, and imports have no circle."""

import ast
import importlib
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

LIBRARY = "millfrf.core."
"""The room whose modules are imported by their names, as those of a library."""

UPWARDS = {("millfrf.core.results", "millfrf.figures")}
"""The one import against the layers: a result asks for its drawing when ``plot`` is called (docs/decisions/0018)."""

MOST_FILES = 26
"""Modules in one folder at most, its ``__init__`` included."""

LEVELS = 2
"""Levels of folders below a room at most."""


def test_rooms_import_each_other_through_their_fronts(house: Any) -> None:
    deep = [
        str(result)
        for result in house.imports
        if result.importer in house.product
        and house.room_of(result.importer) != house.room_of(result.module)
        and house.room_of(result.module) in house.fronts
        and result.module != house.room_of(result.module)
        and not result.module.startswith(LIBRARY)
        and not result.typing_only
    ]
    assert not deep, "\n".join(["import these through the front of their room:", *deep])


def test_a_front_offers_what_others_use(house: Any) -> None:
    used = {(result.module, result.name) for result in house.imports if house.room_of(result.importer) != result.module}
    others = [*(ROOT / "tests").rglob("*.py"), *(ROOT / "docs").rglob("*.md"), ROOT / "millfrf" / "core" / "results.py"]
    others += [path for path in house.product.values() if "drawing(" in path.read_text(encoding="utf-8")]
    elsewhere = "\n".join(path.read_text(encoding="utf-8") for path in others)
    unused = [
        f"{room}.{name}"
        for room, names in house.fronts.items()
        for name in names
        if room != "millfrf" and (room, name) not in used and name not in elsewhere
    ]
    assert not unused, f"no other room, example, benchmark or test uses {unused}; take them out of the front"


def test_fronts_name_in_all_what_they_import(house: Any) -> None:
    for room, names in house.fronts.items():
        assert set(importlib.import_module(room).__all__) == set(names), room


def test_no_private_name_is_imported(house: Any) -> None:
    private = [str(result) for result in house.imports if result.name.startswith("_") and result.name != "__version__"]
    assert not private, "\n".join(["a name that two modules need is public:", *private])


def test_no_name_of_a_front_is_a_module_of_its_room(house: Any) -> None:
    hidden = [
        f"{room}.{name}" for room, names in house.fronts.items() for name in names if f"{room}.{name}" in house.files
    ]
    assert not hidden, f"name the module differently from what it offers: {hidden}"


def test_folders_are_neither_crowded_nor_deep(house: Any) -> None:
    counts = Counter(path.parent for path in house.product.values())
    crowded = {str(folder.relative_to(ROOT)): count for folder, count in counts.items() if count > MOST_FILES}
    assert not crowded
    deep = [name for name in house.product if name.count(".") - house.room_of(name).count(".") - 1 > LEVELS]
    assert not deep


def _edges(house: Any) -> dict[str, set[str]]:
    """From each module to those that define the names it imports; imports for annotations alone do not count."""
    edges: dict[str, set[str]] = {name: set() for name in house.product}
    for result in house.imports:
        home = house.home_of(result.module, result.name)
        upwards = any(result.importer == low and home.startswith(high) for low, high in UPWARDS)
        if (
            result.importer in edges
            and home in edges
            and home != result.importer
            and not result.typing_only
            and not upwards
        ):
            edges[result.importer].add(home)
    return {name: set() if path.name == "__init__.py" else edges[name] for name, path in house.product.items()}


def _circle(edges: dict[str, set[str]]) -> list[str]:
    """One circle of modules, or nothing: depth-first search with the path to the current module."""
    done: set[str] = set()

    def search(name: str, path: list[str]) -> list[str]:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return []
        for target in sorted(edges.get(name, ())):
            circle = search(target, [*path, name])
            if circle:
                return circle
        done.add(name)
        return []

    return next((circle for name in sorted(edges) if (circle := search(name, []))), [])


def test_no_circle_among_modules(house: Any) -> None:
    edges = _edges(house)
    assert sum(map(len, edges.values())) > 1000, "the imports were not read"
    circle = _circle(edges)
    assert not circle, " -> ".join(circle)


@pytest.mark.parametrize(
    ("edges", "length"), [({"a": {"b"}, "b": {"c"}, "c": {"a"}}, 4), ({"a": {"b", "c"}, "b": {"c"}, "c": set()}, 0)]
)
def test_circles_are_found(edges: dict[str, set[str]], length: int) -> None:
    assert len(_circle(edges)) == length


def test_every_package_says_what_it_holds(house: Any) -> None:
    silent = [
        name
        for name, path in house.product.items()
        if path.name == "__init__.py" and not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not silent


HEAVY = ("numpy", "scipy", "numba", "matplotlib", "pint", "h5py", "pydantic", "bokeh")
"""Libraries that ``import millfrf`` must not load: together they take seconds."""


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = f"import sys, millfrf\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
