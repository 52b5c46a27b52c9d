"""Mutated files of every kind end in one line, soon and without much memory."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")


@pytest.fixture(scope="session")
def kinds_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for library in ("can", "cantools", "nptdms", "pyuff"):
        pytest.importorskip(library)
    spec = importlib.util.spec_from_file_location("kinds", Path(__file__).with_name("kinds.py"))
    assert spec is not None
    assert spec.loader is not None
    kinds = importlib.util.module_from_spec(spec)
    sys.modules["kinds"] = kinds
    spec.loader.exec_module(kinds)
    folder = tmp_path_factory.mktemp("kinds")
    kinds.make_kinds(folder)
    return folder


def _read(folder: Path, work: Path, first: int, last: int) -> str:
    command = [
        sys.executable,
        str(Path(__file__).with_name("reader.py")),
        str(folder),
        str(work),
        str(first),
        str(last),
    ]
    environment = os.environ | {"EAGER_IMPORT": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.mark.long
def test_some_mutated_files_end_in_one_line(kinds_folder: Path, tmp_path: Path) -> None:
    assert _read(kinds_folder, tmp_path, 0, 300) == ""


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_ten_thousand_mutated_files_end_in_one_line(part: int, kinds_folder: Path, tmp_path: Path) -> None:
    assert _read(kinds_folder, tmp_path, 1000 * part, 1000 * part + 1000) == ""
