"""A user's files beside a script hide none of our packages; the few names at the root are guarded."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import millfrf

ROOT = Path(__file__).resolve().parents[2]


def _python(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


def test_the_guard_knows_every_package_at_the_root() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert {*millfrf.PACKAGES, "millfrf"} == set(project["tool"]["importlinter"]["root_packages"])


def test_files_named_like_our_rooms_hide_nothing(tmp_path: Path) -> None:
    for room in ("figures", "stability", "cutting", "mismatch", "robot_model", "core", "report"):
        (tmp_path / f"{room}.py").write_text("raise SystemExit('the wrong file ran')\n")
    (tmp_path / "acquisition").mkdir()  # a folder without modules is no package
    (tmp_path / "notes.py").write_text("import millfrf as mf\nprint(mf.lobes.__name__, mf.Recording.__name__)\n")
    ended = _python(tmp_path, "notes.py")
    assert ended.stdout.split() == ["lobes", "Recording"], ended.stderr
    assert _python(tmp_path, "-m", "millfrf", "lobes", "--help").returncode == 0


@pytest.mark.parametrize("command", [("-m", "millfrf", "--version"), ("-c", "import millfrf")])
def test_a_file_that_hides_a_package_is_named_and_not_run(tmp_path: Path, command: tuple[str, str]) -> None:
    hiding = tmp_path / "estimation.py"
    hiding.write_text("raise SystemExit('the wrong file ran')\n")
    ended = _python(tmp_path, *command)
    assert ended.returncode == 1
    line = ended.stderr.strip().splitlines()[-1]
    assert line == f"ImportError: {hiding} hides the package 'estimation' of millfrf: rename it"
