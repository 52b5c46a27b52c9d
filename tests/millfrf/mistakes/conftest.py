"""The laboratory's good files, made once, and the modules of this folder under their own names."""

import importlib.util
import sys
from pathlib import Path

import pytest

_SPOIL = ("spoil_texts", "spoil_recordings", "spoil_results", "spoil_robots", "spoil_exports", "spoiling")

for _name in ("good_files", *_SPOIL, "the_table"):
    _spec = importlib.util.spec_from_file_location(_name, Path(__file__).with_name(f"{_name}.py"))
    assert _spec is not None
    assert _spec.loader is not None
    _module = importlib.util.module_from_spec(_spec)
    sys.modules[_name] = _module
    _spec.loader.exec_module(_module)


@pytest.fixture(scope="session")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with good files of every kind; tests copy it."""
    folder = tmp_path_factory.mktemp("good")
    sys.modules["good_files"].make(folder)
    return folder
