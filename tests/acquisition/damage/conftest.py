"""Makes `power_failures` importable for the tests beside it."""

import importlib.util
import sys
from pathlib import Path

_spec = importlib.util.spec_from_file_location("power_failures", Path(__file__).with_name("power_failures.py"))
assert _spec is not None
assert _spec.loader is not None
_module = importlib.util.module_from_spec(_spec)
sys.modules["power_failures"] = _module
_spec.loader.exec_module(_module)
