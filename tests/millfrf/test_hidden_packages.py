"""A user's file that hides one of our packages is named in one line, before anything imports it."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from millfrf.hidden_packages import ROOMS, hiding_file

ROOT = Path(__file__).resolve().parents[2]


def _python(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


def test_the_guard_looks_at_every_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert set(ROOMS) | {"millfrf"} == set(project["tool"]["importlinter"]["root_packages"])
    assert hiding_file() == ""


@pytest.mark.parametrize("room", ["stability", "cutting", "foundation"])
def test_the_command_line_names_the_file_in_one_line(tmp_path: Path, room: str) -> None:
    (tmp_path / f"{room}.py").write_text("raise SystemExit('the wrong file ran')\n")
    ended = _python(tmp_path, "-m", "millfrf", "--help")
    assert ended.returncode == 2
    assert ended.stderr.strip() == f"millfrf: ./{room}.py hides the package '{room}' of millfrf: rename it"


def test_an_import_names_the_file_in_its_error(tmp_path: Path) -> None:
    (tmp_path / "stability.py").write_text("raise SystemExit('the wrong file ran')\n")
    ended = _python(tmp_path, "-c", "import millfrf")
    assert ended.returncode == 1
    line = ended.stderr.strip().splitlines()[-1]
    assert line == "ImportError: ./stability.py hides the package 'stability' of millfrf: rename it"


def test_a_package_elsewhere_on_the_path_is_named_by_its_folder(tmp_path: Path) -> None:
    other = tmp_path / "elsewhere"
    (other / "figures").mkdir(parents=True)
    (other / "figures" / "__init__.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(other)!r}); import millfrf"
    work = tmp_path / "work"
    work.mkdir()
    ended = _python(work, "-c", code)
    line = f"{other / 'figures'} hides the package 'figures' of millfrf: rename it"
    assert ended.stderr.strip().splitlines()[-1] == f"ImportError: {line}"


def test_a_folder_without_modules_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "figures").mkdir()  # a user's folder of pictures
    (tmp_path / "notes.py").write_text("import millfrf\n")
    ended = _python(tmp_path, "notes.py")
    assert ended.returncode == 0, ended.stderr
