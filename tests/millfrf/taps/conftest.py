"""The simulated hammer tests of `tests/estimation/hammer` under their own name."""

import importlib.util
import sys
from pathlib import Path

_file = Path(__file__).resolve().parents[2] / "estimation" / "hammer" / "simulated_taps.py"
_spec = importlib.util.spec_from_file_location("simulated_taps", _file)
assert _spec is not None
assert _spec.loader is not None
_module = importlib.util.module_from_spec(_spec)
sys.modules["simulated_taps"] = _module
_spec.loader.exec_module(_module)
