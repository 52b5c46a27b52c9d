"""Shared fixtures and options: measured data of other laboratories, long tests, and the kernels compiled first."""

import os
import subprocess
import sys
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

from estimation import write_frf
from millfrf.core.compilation import CUTTING, DIAGNOSIS, SIMULATION, STABILITY
from replay_data import table_one_model

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured data, ``../shared/data`` or ``$MILLFRF_SHARED/data``; the test skips without it."""
    root = Path(__file__).resolve().parents[1]
    folder = Path(os.environ.get("MILLFRF_SHARED", root.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"measured data of other laboratories are not at {folder}; set MILLFRF_SHARED to the folder above")
    return folder


@pytest.fixture
def simulated_frf(tmp_path: Path) -> str:
    """A file with the FRF of the robot of table 1 from 8 to 60 Hz, without noise."""
    path = tmp_path / "frf.h5"
    write_frf(path, table_one_model().frf(np.arange(8.0, 60.0, 0.25)))
    return str(path)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--long``: which tests marked ``long`` run."""
    text = "which tests marked 'long' run: all; none; or those of rooms that a change touches (see tests/touched.py)"
    parser.addoption("--long", choices=("all", "none", "touched"), default="all", help=text)


def pytest_configure(config: pytest.Config) -> None:
    """Compile all kernels before the first test, on two cores, so that no two workers compile the same one."""
    if hasattr(config, "workerinput"):
        return
    code = "import sys; from millfrf.core.compilation import compile_kernels; compile_kernels(*sys.argv[1:])"
    parts = ((*CUTTING, *STABILITY), (*SIMULATION, *DIAGNOSIS))
    running = [subprocess.Popen([sys.executable, "-c", code, *modules]) for modules in parts]
    for process in running:
        if process.wait():
            pytest.exit("the kernels cannot be compiled; see the lines above", returncode=3)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the long tests that ``--long`` leaves out, and run the others of them first."""
    option = config.getoption("--long")
    selected = [item for item in items if not _is_long(item) or _is_selected(item, option)]
    chosen = set(selected)
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    # Two workers finish together only if no long test begins last.
    items[:] = sorted(selected, key=_is_long, reverse=True)


def _is_long(item: pytest.Item) -> bool:
    return item.get_closest_marker("long") is not None


def _is_selected(item: pytest.Item, option: str) -> bool:
    return option == "all" or (option == "touched" and _touched().is_touched(item.path))


@cache
def _touched() -> Any:
    """The module ``touched`` beside this file; it is loaded by its path because a folder of tests is no package."""
    spec = spec_from_file_location("touched", Path(__file__).with_name("touched.py"))
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
