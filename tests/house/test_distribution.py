"""What is published is consistent, and states the origin of everything in it."""

import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest

from millfrf.version import __version__

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def citation() -> dict[str, str]:
    """Top-level values of CITATION.cff that stand on one line."""
    lines = (ROOT / "CITATION.cff").read_text(encoding="utf-8").splitlines()
    pairs = (re.fullmatch(r'([\w-]+): "?(.*?)"?', line) for line in lines)
    return {pair[1]: pair[2] for pair in pairs if pair}


def test_the_citation_names_this_version_licence_and_authors(citation: dict[str, Any]) -> None:
    assert citation["version"] == __version__
    assert citation["license"] == PROJECT["project"]["license"]
    assert re.fullmatch(r"\d{4}-\d{2}-\d{2}", citation["date-released"])
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert all(f"name: {author['name']}" in text for author in PROJECT["project"]["authors"])


def _data_files() -> list[Path]:
    """Files of the packages that are no Python, as git knows them."""
    rooms = PROJECT["tool"]["importlinter"]["root_packages"]
    listed = subprocess.run(["git", "ls-files", *rooms], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        names = [path.relative_to(ROOT).as_posix() for room in rooms for path in (ROOT / room).rglob("*.*")]
    else:
        names = listed.stdout.splitlines()
    return [Path(name) for name in names if not name.endswith((".py", ".pyi", ".pyc", ".nbi", ".nbc"))]


def _within_package(path: Path) -> Path:
    """Path of a data file relative to the package that holds it: patterns of package data begin there."""
    package = next(folder for folder in path.parents if (ROOT / folder / "__init__.py").is_file())
    return path.relative_to(package)


def _is_packaged(path: Path, patterns: list[str]) -> bool:
    inner = _within_package(path)
    return any(len(inner.parts) == len(Path(pattern).parts) and inner.match(pattern) for pattern in patterns)


def test_every_data_file_is_packaged() -> None:
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["*"]
    files = _data_files()
    assert len(files) > 20
    assert not [path for path in files if not _is_packaged(path, patterns)]


def test_every_kind_of_data_file_is_named_with_its_licence() -> None:
    named = re.findall(r"`([^`]+)`", (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8"))
    assert not [path for path in _data_files() if not any(path.match(n) or fnmatch(str(path), n) for n in named)]


def test_licence_files_are_there_and_robots_made_of_others_are_listed() -> None:
    assert all((ROOT / name).is_file() for name in PROJECT["project"]["license-files"])
    named = (ROOT / "THIRD_PARTY.md").read_text(encoding="utf-8")
    robots = (ROOT / "millfrf" / "robot_model" / "robots").glob("*.toml")
    others = [path.name for path in robots if "ROS-Industrial" in path.read_text(encoding="utf-8")]
    assert others
    assert not [name for name in others if f"/{name}`" not in named]
