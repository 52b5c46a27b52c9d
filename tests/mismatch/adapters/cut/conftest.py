"""Loads the independent simulator by its path: test folders are no packages."""

import importlib.util
import sys
from pathlib import Path

_PATH = Path(__file__).with_name("independent_cut.py")
_SPEC = importlib.util.spec_from_file_location("independent_cut", _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_MODULE = importlib.util.module_from_spec(_SPEC)
sys.modules["independent_cut"] = _MODULE
_SPEC.loader.exec_module(_MODULE)
