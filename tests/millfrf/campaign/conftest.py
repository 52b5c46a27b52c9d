"""Trials that benchmarks run too, loaded from their files: test folders are no packages."""

import importlib.util
import sys
from pathlib import Path

PARTS = [
    Path(__file__).parent / f"{name}.py" for name in ("overhead_of_tasks", "simulated_series", "unmeasured_postures")
]
PARTS.append(Path(__file__).parents[3] / "benchmarks" / "campaign_trial.py")

for path in PARTS:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
