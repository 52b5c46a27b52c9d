"""Fixtures of the stability tests: literature benchmarks that several files use."""

import importlib.util
import sys
from pathlib import Path

_PATH = Path(__file__).with_name("benchmarks_of_literature.py")
_SPEC = importlib.util.spec_from_file_location("benchmarks_of_literature", _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_MODULE = importlib.util.module_from_spec(_SPEC)
sys.modules["benchmarks_of_literature"] = _MODULE
_SPEC.loader.exec_module(_MODULE)
