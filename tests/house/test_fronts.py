"""Rooms, and shelves inside a room, import each other through their fronts. Fronts are lazy and keep their promise."""

import ast
import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]

NOT_YET: set[str] = set()
"""Rooms that wait for their fronts: their own shelves import each other's modules, others reach their insides."""

FACE = "millfrf"
"""Its front is the face for notebooks. Examples may also ask the front of one of its shelves, or run its commands."""

EAGER = {
    "foundation.results",
    "millfrf.commands",
    "millfrf.robot.commands",
    "mismatch.physics",
    "mismatch.adapters.cut.physics",
}
"""Fronts that load at once: the base of results, commands (nothing heavy), and libraries that find their own files."""

FOUND_BY_ITSELF = "PHYSICS"
"""The name in a file of a library of causes; who needs one certain cause asks its file."""


def _waits(*modules: str) -> bool:
    return any(module.split(".")[0] in NOT_YET for module in modules)


def _asks_a_shelf_of_the_face(importer: str, module: str) -> bool:
    return importer.startswith("examples.") and module.startswith(f"{FACE}.") and module.count(".") == 1


def test_rooms_import_each_other_through_their_fronts(house: Any) -> None:
    deep = [
        str(one)
        for one in house.imports
        if one.importer.split(".")[0] != one.module.split(".")[0]
        and one.module not in house.rooms
        and not _waits(one.module)
        and not _asks_a_shelf_of_the_face(one.importer, one.module)
    ]
    assert not deep, "\n".join(["import these through the front of their room:", *deep])


def test_shelves_import_each_other_through_their_fronts(house: Any) -> None:
    deep = []
    for one in house.imports:
        if (
            one.importer.split(".")[0] != one.module.split(".")[0]
            or _waits(one.module)
            or house.is_package(one.importer)
        ):
            continue
        front = house.front_between(one.importer, house.home_of(one.module, one.name))
        if front not in (None, one.module):
            deep.append(f"{one}: the front is {front}")
    assert not deep, "\n".join(["import these through the front of their shelf:", *deep])


def test_no_private_name_is_imported(house: Any) -> None:
    private = [str(one) for one in house.imports if one.name.startswith("_") and not one.name.startswith("__")]
    assert not private, "\n".join(["a name that two modules need is public, in a module of its own:", *private])


def test_no_name_of_a_lazy_front_is_a_submodule(house: Any) -> None:
    # importing the submodule would set the attribute, and the front would show a module in place of the function
    hidden = [
        f"{package}.{name}"
        for package, shown in house.fronts.items()
        if package.split(".")[0] in house.rooms and package not in EAGER
        for name in shown
        if f"{package}.{name}" in house.files
    ]
    assert not hidden, f"name the module apart from what it shows: {hidden}"


def test_every_front_is_lazy_and_says_what_is_on_the_shelf(house: Any) -> None:
    for package, path in house.files.items():
        if not house.is_package(package) or package.split(".")[0] not in house.rooms:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert ast.get_docstring(tree), f"{package} does not say what is on the shelf"
        if house.fronts[package] and package not in EAGER and not _waits(package):
            assert path.with_suffix(".pyi").exists(), f"{package} loads its modules at once; give it a stub"
            own = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
            assert not own, f"{package} defines something of its own beside a stub"


def test_stubs_say_in_all_what_they_import(house: Any) -> None:
    for package, shown in house.fronts.items():
        stub = house.files[package].with_suffix(".pyi")
        if not stub.exists():
            continue
        assigned = [node for node in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(node, ast.Assign)]
        assert [ast.literal_eval(node.value) for node in assigned] == [sorted(shown, key=_as_ruff_sorts)], package


def _as_ruff_sorts(name: str) -> tuple[int, str]:
    return (0 if name.isupper() else 1 if name[:1].isupper() else 2, name)


def test_every_stub_resolves() -> None:
    # EAGER_IMPORT makes lazy_loader resolve each name of each front at once
    code = (
        "import importlib, pkgutil, sys\n"
        "for room in sys.argv[1:]:\n"
        "    package = importlib.import_module(room)\n"
        "    for found in pkgutil.walk_packages(package.__path__, room + '.'):\n"
        "        found.ispkg and importlib.import_module(found.name)\n"
    )
    rooms = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))
    environment = {**os.environ, "EAGER_IMPORT": "1", "PYTHONPATH": str(ROOT)}
    run = subprocess.run([sys.executable, "-c", code, *rooms], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("package", ["estimation", "stability", "robot_model", "modal_fit"])
def test_a_front_shows_what_its_stub_names(house: Any, package: str) -> None:
    module = importlib.import_module(package)
    assert sorted(module.__all__) == sorted(house.fronts[package])
    assert all(hasattr(module, name) for name in house.fronts[package])


HEAVY = ("scipy", "numba", "matplotlib", "pint", "pyuff", "nptdms", "h5py", "pydantic", "bokeh")
"""Libraries that a front must not load: they take a second together, and most users of a room need few of them."""


def test_importing_a_room_loads_nothing_heavy() -> None:
    rooms = sorted({path.parent.name for path in ROOT.glob("*/__init__.py")} - NOT_YET)
    code = f"import sys, {', '.join(rooms)}\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    environment = {**os.environ, "EAGER_IMPORT": "", "PYTHONPATH": str(ROOT)}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.split() == []
