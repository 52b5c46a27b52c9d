"""The house itself: one parent folder for all rooms, and no room outside the plan."""

import importlib
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def _packages() -> list[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    include = project["tool"]["setuptools"]["packages"]["find"]["include"]
    return [name for name in include if not name.endswith(".*")]


def test_all_root_packages_share_one_parent_folder() -> None:
    parents = {Path(importlib.import_module(name).__file__ or "").resolve().parents[1] for name in _packages()}
    assert parents == {ROOT}


def test_every_package_folder_is_packaged_typed_and_linted() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert folders == set(_packages())
    assert folders == set(project["tool"]["importlinter"]["root_packages"])
    assert folders == set(project["tool"]["mypy"]["packages"])
    assert all((ROOT / name / "py.typed").exists() for name in folders)


def test_every_folder_of_modules_is_a_package() -> None:
    # a folder without __init__.py imports from a checkout and is missing from the wheel
    sources = [path for name in _packages() for path in (ROOT / name).rglob("*.py")]
    assert not {path.parent for path in sources if not (path.parent / "__init__.py").exists()}


def test_exported_names_exist() -> None:
    for name in _packages():
        module = importlib.import_module(name)
        missing = [public for public in getattr(module, "__all__", []) if not hasattr(module, public)]
        assert not missing, f"{name} exports names that are not there: {missing}"
