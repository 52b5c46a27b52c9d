"""Recordings of a simulated cell that shares no code with the package, for tests of what contradicts what."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))  # benchmarks are no installed package

from benchmarks.lab_cell import Record


@pytest.fixture
def written(tmp_path: Path) -> Callable[[dict[str, Record]], list[Path]]:
    """Writes records into the test's folder."""
    return lambda records: [each.write(tmp_path / f"{name}.h5") for name, each in records.items()]
