"""Every module of the inference core has a test of its own name."""

from pathlib import Path

import mismatch.inference


def test_every_module_has_a_test_of_its_name() -> None:
    modules = {path.stem for path in Path(mismatch.inference.__file__).parent.glob("*.py")} - {"__init__"}
    tests = {path.stem.removeprefix("test_") for path in Path(__file__).parent.glob("test_*.py")}
    assert modules <= tests, f"without a test of their name: {sorted(modules - tests)}"
